// SPDX-License-Identifier: Apache-2.0
// Orders points by their places on a space-filling curve.
#include "converter/formats/space_curve.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/system/assert.h"

namespace tg {
namespace {

constexpr int kAxes = 3, kBits = 21;

}  // namespace

std::uint64_t hilbertCode(glm::dvec3 p) {
  std::array<std::uint32_t, kAxes> x;
  for (int k = 0; k < kAxes; ++k) {
    x[k] = static_cast<std::uint32_t>(std::clamp(p[k], 0.0, 1.0) * static_cast<double>((1 << kBits) - 1));
  }
  // The cubes of each level back to where the curve enters the first of them: mirrored or two axes exchanged.
  for (std::uint32_t bit = 1u << (kBits - 1); bit > 1; bit >>= 1) {
    for (int k = 0; k < kAxes; ++k) {
      const std::uint32_t changed = x[k] & bit ? bit - 1 : (x[0] ^ x[k]) & (bit - 1);
      x[0] ^= changed;
      if (!(x[k] & bit)) x[k] ^= changed;
    }
  }
  // From the Gray code in which the eight cubes then follow each other.
  for (int k = 1; k < kAxes; ++k) x[k] ^= x[k - 1];
  std::uint32_t flips = 0;
  for (std::uint32_t bit = 1u << (kBits - 1); bit > 1; bit >>= 1) {
    if (x[kAxes - 1] & bit) flips ^= bit - 1;
  }
  std::uint64_t code = 0;
  for (int bit = kBits - 1; bit >= 0; --bit) {
    for (int k = 0; k < kAxes; ++k) code = code << 1 | ((x[k] ^ flips) >> bit & 1);
  }
  return code;
}

std::vector<std::uint32_t> hilbertOrder(std::span<const glm::vec3> points) {
  TG_ASSERT(!points.empty(), "points to order");
  glm::dvec3 low(points.front()), high(low);
  for (const glm::vec3& point : points) {
    low = glm::min(low, glm::dvec3(point));
    high = glm::max(high, glm::dvec3(point));
  }
  const glm::dvec3 size = high - low;
  const double extent = std::max({size.x, size.y, size.z, 1e-30});
  std::vector<std::pair<std::uint64_t, std::uint32_t>> codes(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    codes[i] = {hilbertCode((glm::dvec3(points[i]) - low) / extent), static_cast<std::uint32_t>(i)};
  }
  std::sort(codes.begin(), codes.end());
  std::vector<std::uint32_t> order(points.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = codes[i].second;
  return order;
}

}  // namespace tg
