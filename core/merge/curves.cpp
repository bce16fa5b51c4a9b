// SPDX-License-Identifier: Apache-2.0
// Two sorts by Morton codes.
#include "core/merge/curves.h"

#include <algorithm>
#include <cstdint>
#include <glm/common.hpp>
#include <utility>

namespace tg {
namespace {

// p in [0, 1]^3 on a space-filling curve: 21 bits an axis, interleaved.
std::uint64_t mortonCode(glm::dvec3 p) {
  constexpr int bits = 21;
  const glm::dvec3 scaled = glm::clamp(p, 0.0, 1.0) * static_cast<double>((1 << bits) - 1);
  std::uint64_t code = 0;
  for (int bit = bits - 1; bit >= 0; --bit) {
    for (int k = 0; k < 3; ++k) code = code << 1 | (static_cast<std::uint64_t>(scaled[k]) >> bit & 1);
  }
  return code;
}

}  // namespace

std::array<std::vector<std::uint32_t>, 2> curveOrders(std::span<const glm::dvec3> places) {
  constexpr double kShifts[] = {0.0, 0.37}, kPart = 0.6;  // of the curves' cube
  std::array<std::vector<std::uint32_t>, 2> orders;
  if (places.empty()) return orders;
  glm::dvec3 low(places.front()), high(low);
  for (const glm::dvec3& place : places) {
    low = glm::min(low, place);
    high = glm::max(high, place);
  }
  const glm::dvec3 size = high - low;
  const double extent = std::max({size.x, size.y, size.z, 1e-30});
  std::vector<std::pair<std::uint64_t, std::uint32_t>> codes(places.size());
  for (std::size_t curve = 0; curve < orders.size(); ++curve) {
    for (std::size_t i = 0; i < places.size(); ++i) {
      codes[i] = {mortonCode(kShifts[curve] + kPart * (places[i] - low) / extent), static_cast<std::uint32_t>(i)};
    }
    std::sort(codes.begin(), codes.end());
    orders[curve].reserve(codes.size());
    for (const auto& [code, i] : codes) orders[curve].push_back(i);
  }
  return orders;
}

}  // namespace tg
