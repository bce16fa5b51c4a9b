// SPDX-License-Identifier: Apache-2.0
// How close renderings of a model come to photographs.
#pragma once
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/image/flip.h"
#include "training/data/dataset.h"
#include "training/score/lpips.h"
#include "training/step/run_state.h"

namespace tg {

struct ViewScore {
  std::string name;
  double psnr = 0;        // [dB] after rounding to 8 bit, as papers report
  double psnr_float = 0;  // [dB] of values clamped to [0, 1]
  double ssim = 0;
  std::optional<double> flip;  // where asked for
  std::optional<double> lpips;
};

struct ScoreOptions {
  bool flip = false;
  double pixels_per_degree = kFlipPixelsPerDegree;
  const Lpips* lpips = nullptr;
  LpipsRange lpips_range = LpipsRange::symmetric;
};

// `picture` has 3 channels and values in [0, 1]. Masked pixels are black in both pictures for the metrics that look at
// neighbourhoods (SSIM, FLIP, LPIPS), and left out of all means but LPIPS's: what they hold makes no difference.
// `flip_map` receives the map where FLIP is asked for.
ViewScore scoreView(const std::string& name, const ViewPixels& photograph, const Image& picture,
                    const ScoreOptions& options = {}, Image* flip_map = nullptr);
// Of every metric; one that no view has stays away.
ViewScore meanView(std::span<const ViewScore> scores);
Score meanScore(std::span<const ViewScore> scores);

// PSNR and SSIM of several views. Pictures come back as 3 channels of the camera's size; they are clamped to [0, 1] for
// the comparison.
using RenderFunction = std::function<Image(const Camera&)>;
std::vector<ViewScore> scoreViews(const Dataset& dataset, std::span<const std::size_t> views,
                                  const RenderFunction& render);

void clampToUnit(Image& picture);
// A picture of the camera's size as an image of 3 channels.
Image imageOf(std::span<const glm::vec3> picture, const Camera& camera);

}  // namespace tg
