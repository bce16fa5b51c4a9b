// SPDX-License-Identifier: Apache-2.0
// How coarse texels may be stored where they weigh less.
#include "converter/formats/texel_spread.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/model/atlas.h"
#include "core/system/assert.h"

namespace tg {
namespace {

// Where the texels of trained models come nearest to their source at the same bytes (docs/lab/converter.md).
constexpr double kShareExponent = 0.7;
constexpr double kOpacityExponent = 0.35;
constexpr double kMostSpread = 16;
constexpr double kDeadZone = 0.1;  // [steps] that texels are nearer to no change than they are
constexpr double kPercentile = 0.999;

}  // namespace

std::vector<double> texelSpreads(int width, int height) {
  TG_ASSERT(width >= 1 && height >= 1, "a texture has texels");
  const std::vector<double> u = texelShares(width), v = texelShares(height);
  const double most = *std::max_element(u.begin(), u.end()) * *std::max_element(v.begin(), v.end());
  std::vector<double> spreads;
  for (const double row : v) {
    for (const double column : u) {
      spreads.push_back(std::min(std::pow(most / (row * column), kShareExponent), kMostSpread));
    }
  }
  return spreads;
}

double opacitySpread(double opacity) {
  return std::min(std::pow(std::max(opacity, 1e-6), -kOpacityExponent), kMostSpread);
}

double wholeSteps(double steps) {
  return std::copysign(std::floor(std::max(std::abs(steps) + 0.5 - kDeadZone, 0.0)), steps);
}

float mostOf(std::vector<float>& magnitudes) {
  TG_ASSERT(!magnitudes.empty(), "there are magnitudes");
  const auto at =
      magnitudes.begin() + static_cast<std::ptrdiff_t>(kPercentile * static_cast<double>(magnitudes.size() - 1));
  std::nth_element(magnitudes.begin(), at, magnitudes.end());
  return *at;
}

double reachingStep(double step, double most) {
  TG_ASSERT(step > 0, "steps have a width");
  while (step * kByteSteps < most) step *= 2;
  return step;
}

}  // namespace tg
