// SPDX-License-Identifier: Apache-2.0
// Compares a model with the photographs that were held out: `evaluate MODEL DATASET`.
#include <cstdio>

#include "textured_gaussians/textured_gaussians.h"

namespace tg = textured_gaussians;

int main(int count, char** arguments) try {
  if (count != 3) return 1;
  const tg::Model model = tg::Model::load(arguments[1]);
  const tg::Evaluation evaluation = tg::evaluate(model, tg::Dataset::load(arguments[2]));
  for (const std::string& warning : evaluation.warnings) std::fprintf(stderr, "evaluate: %s\n", warning.c_str());
  for (const tg::ViewScore& view : evaluation.views) {
    std::printf("%s: %.2f dB, SSIM %.4f\n", view.name.c_str(), view.psnr, view.ssim);
  }
  std::printf("mean: %.2f dB, SSIM %.4f\n", evaluation.mean.psnr, evaluation.mean.ssim);
} catch (const tg::Error& error) {
  std::fprintf(stderr, "evaluate: %s\n", error.what());
  return static_cast<int>(error.kind());
}
