// SPDX-License-Identifier: Apache-2.0
// Renders, clamps, compares.
#include "training/evaluate.h"

#include <algorithm>

#include "core/metrics.h"

namespace tg {

std::vector<ViewScore> scoreViews(const Dataset& dataset, std::span<const std::size_t> views,
                                  const RenderFunction& render, const PictureSink& sink) {
  std::vector<ViewScore> scores;
  for (std::size_t i : views) {
    const View& view = dataset.views[i];
    Image picture = render(view.camera);
    for (float& value : picture.data) value = std::clamp(value, 0.0f, 1.0f);
    const Image photograph = dataset.pixels(i)->image();
    scores.push_back({view.camera.name, psnr8Bit(picture, photograph), ssim(picture, photograph)});
    if (sink) sink(view, picture);
  }
  return scores;
}

Score meanScore(std::span<const ViewScore> scores) {
  Score mean;
  mean.views = scores.size();
  for (const ViewScore& score : scores) {
    mean.psnr += score.psnr / static_cast<double>(scores.size());
    mean.ssim += score.ssim / static_cast<double>(scores.size());
  }
  return mean;
}

}  // namespace tg
