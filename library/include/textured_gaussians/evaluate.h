// SPDX-License-Identifier: Apache-2.0
// How close pictures of a model come to photographs.
#pragma once
#include <array>
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
  // RGB behind transparent photographs and the model: DatasetOptions::background or DatasetData::background where the
  // data set was made with one; else the model's, where it is known, as of a .tgz and of what has cameras; else
  // Dataset::background().
  std::array<float, 3> background = {0, 0, 0};
  std::vector<std::string> warnings;  // of a model that was trained on others than these photographs, a line each
};

// As tgeval does it: the same numbers. Pictures are clamped to [0, 1]. Photographs are decoded anew where the
// background is not Dataset::background(). Throws Error(usage) for a split without photographs, and what decoding them
// throws.
Evaluation evaluate(const Model& model, const Dataset& dataset, const EvaluateOptions& options = {});

}  // namespace textured_gaussians
