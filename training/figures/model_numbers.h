// SPDX-License-Identifier: Apache-2.0
// How large a model is, and how its Gaussians are distributed.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "core/model/effective_rank.h"
#include "core/model/model.h"

namespace tg {

struct ModelNumbers {
  static constexpr int kOpacityBins = 40;  // of width 0.025 over [0, 1], the last one closed
  static constexpr int kScaleBins = 120;   // of a tenth of a decade over [1e-7, 1e5]; those beyond lie in the end bins
  static constexpr double kLowestScale = -7, kScaleStep = 0.1;  // [log10 of world units]
  static constexpr int kTexelBins = 18;  // none, 1, 2 to 3, 4 to 7, ... texels; more lie in the last one

  std::size_t gaussians = 0, textured = 0, texels = 0, parameters = 0;
  std::uintmax_t bytes = 0;  // of the model's file
  std::array<std::size_t, kOpacityBins> opacity{};
  std::array<std::size_t, kScaleBins> scale{};  // three sigmas a Gaussian
  std::array<std::size_t, kTexelBins> texel_counts{};
  EffectiveRanks ranks;
};
ModelNumbers numbersOf(const GaussianModel& model, std::uintmax_t bytes);

}  // namespace tg
