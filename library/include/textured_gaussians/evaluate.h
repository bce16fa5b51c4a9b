// SPDX-License-Identifier: Apache-2.0
// How close pictures of a model come to photographs.
#pragma once
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "textured_gaussians/dataset.h"
#include "textured_gaussians/model.h"
#include "textured_gaussians/render.h"

namespace textured_gaussians {

struct ViewScore {
  std::string name;            // of the photograph
  double psnr = 0;             // [dB] after rounding to 8 bits; infinity when equal
  double ssim = 0;             // up to 1
  std::optional<double> flip;  // 0 (equal) to 1; where asked for
};

enum class Split { test, train, all };

struct EvaluateOptions {
  Split split = Split::test;
  bool flip = false;  // takes longer
  TextureMode textures = TextureMode::rgba;
  // After every photograph, on the caller's thread: how many of how many are done. What it throws ends the evaluation.
  std::function<void(std::size_t done, std::size_t photographs)> progress = {};
};

struct Evaluation {
  std::vector<ViewScore> views;  // in the data set's order
  ViewScore mean;                // of every figure; its name is empty
};

// Pictures are drawn over the data set's background and clamped to [0, 1]. Throws Error(usage) for a split without
// photographs, and what decoding them throws.
Evaluation evaluate(const Model& model, const Dataset& dataset, const EvaluateOptions& options = {});

}  // namespace textured_gaussians
