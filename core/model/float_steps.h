// SPDX-License-Identifier: Apache-2.0
// Whether floats are near enough to one another at a place for what stands there.
#pragma once
#include <cmath>
#include <limits>
#include <string>

#include "core/system/numbers.h"

namespace tg {

// "lie 5e+06 from the origin, where floats are 0.5 apart" for a coordinate of this size and details of that
// [world units], where floats are more than a tenth of those apart; "" where they are near enough: rounding moves what
// stands there by 3 % of a detail in the mean.
inline std::string coarseFloats(double coordinate, double detail) {
  constexpr double kCoarse = 0.1;
  const auto place = static_cast<float>(coordinate);
  const double step = static_cast<double>(std::nextafter(place, std::numeric_limits<float>::infinity())) - place;
  if (!(step > kCoarse * detail)) return {};
  return formatted("lie %.3g from the origin, where floats are %.2g apart", coordinate, step);
}

}  // namespace tg
