// SPDX-License-Identifier: Apache-2.0
// How many bits of each attribute a packed file keeps.
#include "converter/gltf/attribute_filters.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/system/assert.h"

namespace tg {
namespace {

using Kind = MeshoptFilter::Kind;

// At steps of 1. What a byte less costs a picture was compared on three models (docs/lab/converter.md).
constexpr double kPositionStep = 1.0 / 16;  // of what smallExtent says
constexpr double kCoefficientStep = 0.03;   // of DC and SH, as SOG's
constexpr double kOpacityStep = 1.0 / 128;
constexpr double kBaseFactor = 4;    // what only other readers show is so much coarser
constexpr double kScaleBits = 7;     // with a sign that is never used
constexpr double kRotationBits = 8;  // at least: the codec packs 5 to 8 alike

// Multiples of the power of 2 nearest to `step`.
MeshoptFilter fixed(double step) {
  const double exponent = std::clamp(std::round(std::log2(step)), -100.0, 100.0);  // of 0 or infinity, too
  return {.kind = Kind::fixed, .exponent = static_cast<int>(exponent)};
}

int bitsFor(double bits) { return std::clamp(static_cast<int>(std::lround(bits)), 3, 14); }

// The scale [world units] along its second longest axis below which a tenth of the Gaussians lie.
double smallExtent(const GaussianModel& model) {
  std::vector<float> extents;
  for (const glm::vec3& s : model.log_scale) {
    extents.push_back(std::max(std::min(s.x, s.y), std::min(std::max(s.x, s.y), s.z)));
  }
  const auto tenth = extents.begin() + static_cast<std::ptrdiff_t>(extents.size() / 10);
  std::nth_element(extents.begin(), tenth, extents.end());
  return std::exp(static_cast<double>(*tenth));
}

}  // namespace

AttributeFilters wholeFilters(bool quantize) {
  AttributeFilters filters;
  if (!quantize) return filters;
  filters.rotation = {Kind::quaternion, 14};
  filters.scale = filters.dc = filters.base_dc = {Kind::exponential, 14};
  filters.sh.fill({Kind::exponential, 10});
  return filters;
}

AttributeFilters filtersInSteps(const GaussianModel& model, double steps) {
  TG_ASSERT(model.size() > 0 && steps > 0, "Gaussians, and steps that have a width");
  AttributeFilters filters;
  const double octaves = std::log2(steps);
  filters.position = fixed(kPositionStep * smallExtent(model) * steps);
  filters.rotation = {
      .kind = Kind::quaternion, .bits = bitsFor(kRotationBits - std::min(octaves, 0.0)), .rounded = true};
  filters.scale = {.kind = Kind::exponential, .bits = bitsFor(kScaleBits - octaves)};
  filters.opacity = fixed(kOpacityStep * steps);
  filters.base_opacity = fixed(kBaseFactor * kOpacityStep * steps);
  filters.dc = fixed(kCoefficientStep * steps);
  filters.base_dc = fixed(kBaseFactor * kCoefficientStep * steps);
  // Half an octave more or less, so that coefficients change from one power of 2 to the next at `steps` of their own.
  for (std::size_t k = 1; k < filters.sh.size(); ++k) {
    filters.sh[k] = fixed(kCoefficientStep * steps * std::exp2((static_cast<double>(k) - 8) / 15));
  }
  return filters;
}

}  // namespace tg
