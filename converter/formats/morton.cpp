// SPDX-License-Identifier: Apache-2.0
// Orders points by their places on a space-filling curve.
#include "converter/formats/morton.h"

#include <algorithm>
#include <utility>

#include "core/system/assert.h"

namespace tg {

std::vector<std::uint32_t> mortonOrder(std::span<const glm::vec3> points) {
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
    codes[i] = {mortonCode((glm::dvec3(points[i]) - low) / extent), static_cast<std::uint32_t>(i)};
  }
  std::sort(codes.begin(), codes.end());
  std::vector<std::uint32_t> order(points.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = codes[i].second;
  return order;
}

}  // namespace tg
