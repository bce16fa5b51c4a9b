// SPDX-License-Identifier: Apache-2.0
// Trains a small model and says how it goes: `train DATASET OUT.tgz ITERATIONS`.
#include <cstdio>

#include "textured_gaussians/textured_gaussians.h"

namespace tg = textured_gaussians;

int main(int count, char** arguments) try {
  if (count != 4) return 1;
  const tg::Dataset dataset = tg::Dataset::load(arguments[1]);
  tg::TrainOptions options;
  options.settings = {{"iterations", arguments[3]}, {"texture-iterations", arguments[3]}, {"gaussians", "1000"}};
  tg::Trainer trainer(dataset, options);
  while (trainer.step()) {
    const tg::TrainProgress progress = trainer.progress();
    if (progress.iteration == progress.iterations) {
      std::printf("%s: %d iterations, %zu Gaussians, %.2f dB\n", progress.stage.c_str(), progress.iteration,
                  progress.gaussians, progress.psnr);
    }
  }
  trainer.model().save(arguments[2]);
} catch (const tg::Error& error) {
  std::fprintf(stderr, "train: %s\n", error.what());
  return static_cast<int>(error.kind());
}
