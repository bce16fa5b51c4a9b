// SPDX-License-Identifier: Apache-2.0
// How close renderings of a model come to photographs.
#pragma once
#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "training/dataset.h"

namespace tg {

struct ViewScore {
  std::string name;
  double psnr = 0;  // [dB] after rounding to 8 bit, as papers report
  double ssim = 0;
};

struct Score {
  double psnr = 0;  // means over the views
  double ssim = 0;
  std::size_t views = 0;
};

// Pictures come back as 3 channels of the camera's size; they are clamped to [0, 1] for the comparison.
using RenderFunction = std::function<Image(const Camera&)>;
// Receives every picture as it is scored.
using PictureSink = std::function<void(const View&, const Image&)>;

std::vector<ViewScore> scoreViews(const Dataset& dataset, std::span<const std::size_t> views,
                                  const RenderFunction& render, const PictureSink& sink = {});
Score meanScore(std::span<const ViewScore> scores);

}  // namespace tg
