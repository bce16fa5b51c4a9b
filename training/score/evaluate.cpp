// SPDX-License-Identifier: Apache-2.0
// Renders, clamps, compares.
#include "training/score/evaluate.h"

#include <algorithm>

#include "core/image/metrics.h"
#include "core/system/assert.h"

namespace tg {

namespace {

// Masked pixels black.
Image masked(Image image, Mask mask) {
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] == 0) std::fill_n(image.data.begin() + static_cast<std::ptrdiff_t>(i * 3), 3, 0.0f);
  }
  return image;
}

}  // namespace

ViewScore scoreView(const std::string& name, const ViewPixels& photograph, const Image& picture,
                    const ScoreOptions& options, Image* flip_map) {
  TG_ASSERT(picture.width == photograph.width && picture.height == photograph.height && picture.channels == 3,
            "the picture is the photograph's view");
  const Image truth = masked(photograph.image(), photograph.mask);
  const Image shown = masked(picture, photograph.mask);
  ViewScore score;
  score.name = name;
  score.psnr = psnr8Bit(shown, truth, photograph.mask);
  score.psnr_float = psnr(shown, truth, photograph.mask);
  score.ssim = ssim(shown, truth, photograph.mask);
  if (options.flip) {
    Image map = flipMap(truth, shown, options.pixels_per_degree);
    score.flip = flip(map, photograph.mask);
    if (flip_map) *flip_map = std::move(map);
  }
  if (options.lpips) score.lpips = options.lpips->distance(truth, shown, options.lpips_range);
  return score;
}

ViewScore meanView(std::span<const ViewScore> scores) {
  ViewScore mean;
  mean.name = "mean";
  const double share = 1.0 / static_cast<double>(std::max<std::size_t>(scores.size(), 1));
  for (const ViewScore& score : scores) {
    mean.psnr += score.psnr * share;
    mean.psnr_float += score.psnr_float * share;
    mean.ssim += score.ssim * share;
    if (score.flip) mean.flip = mean.flip.value_or(0.0) + *score.flip * share;
    if (score.lpips) mean.lpips = mean.lpips.value_or(0.0) + *score.lpips * share;
  }
  return mean;
}

Score meanScore(std::span<const ViewScore> scores) {
  const ViewScore mean = meanView(scores);
  return {mean.psnr, mean.ssim, scores.size()};
}

std::vector<ViewScore> scoreViews(const Dataset& dataset, std::span<const std::size_t> views,
                                  const RenderFunction& render) {
  std::vector<ViewScore> scores;
  for (std::size_t i : views) {
    Image picture = render(dataset.views[i]);
    clampToUnit(picture);
    scores.push_back(scoreView(dataset.views[i].name, *dataset.pixels(i), picture));
  }
  return scores;
}

Image imageOf(std::span<const glm::vec3> picture, const Camera& camera) {
  TG_ASSERT(picture.size() == static_cast<std::size_t>(camera.size.x) * static_cast<std::size_t>(camera.size.y),
            "a colour a pixel");
  Image image(camera.size.x, camera.size.y, 3);
  for (std::size_t i = 0; i < picture.size(); ++i) {
    for (int c = 0; c < 3; ++c) image.data[i * 3 + static_cast<std::size_t>(c)] = picture[i][c];
  }
  return image;
}

void clampToUnit(Image& picture) {
  for (float& value : picture.data) value = std::clamp(value, 0.0f, 1.0f);
}

}  // namespace tg
