// SPDX-License-Identifier: Apache-2.0
// One pass over the Gaussians.
#include "training/figures/model_numbers.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/model/verbs.h"

namespace tg {
namespace {

std::size_t binOf(double place, int bins) {
  return static_cast<std::size_t>(std::clamp(std::floor(place), 0.0, bins - 1.0));
}

}  // namespace

ModelNumbers numbersOf(const GaussianModel& model, std::uintmax_t bytes) {
  ModelNumbers numbers;
  numbers.gaussians = model.size();
  numbers.texels = model.atlas.texels.size();
  numbers.parameters = parameterCount(model);
  numbers.bytes = bytes;
  numbers.ranks = effectiveRanks(model.log_scale);
  for (std::size_t i = 0; i < model.size(); ++i) {
    ++numbers.opacity[binOf(opacityOf(model, i) * ModelNumbers::kOpacityBins, ModelNumbers::kOpacityBins)];
    for (int axis = 0; axis < 3; ++axis) {
      const double decades = model.log_scale[i][axis] / std::log(10.0);
      ++numbers
            .scale[binOf((decades - ModelNumbers::kLowestScale) / ModelNumbers::kScaleStep, ModelNumbers::kScaleBins)];
    }
    const TextureRect rect = rectOf(model, i);
    const std::uint64_t texels = std::uint64_t{rect.width} * rect.height;
    numbers.textured += texels > 0;
    ++numbers.texel_counts[binOf(static_cast<double>(std::bit_width(texels)), ModelNumbers::kTexelBins)];
  }
  return numbers;
}

}  // namespace tg
