// SPDX-License-Identifier: Apache-2.0
// Places in space as one number.
#include "converter/formats/morton.h"

#include <algorithm>
#include <utility>

#include "core/system/assert.h"

namespace tg {

std::uint64_t mortonCode(glm::dvec3 p) {
  constexpr int bits = 21;
  const glm::dvec3 scaled = glm::clamp(p, 0.0, 1.0) * static_cast<double>((1 << bits) - 1);
  std::uint64_t code = 0;
  for (int bit = bits - 1; bit >= 0; --bit) {
    for (int k = 0; k < 3; ++k) code = code << 1 | (static_cast<std::uint64_t>(scaled[k]) >> bit & 1);
  }
  return code;
}

std::vector<std::uint32_t> mortonOrder(std::span<const glm::vec3> means) {
  TG_ASSERT(!means.empty(), "something to order");
  glm::dvec3 low(means.front()), high(low);
  for (const glm::vec3& mean : means) {
    low = glm::min(low, glm::dvec3(mean));
    high = glm::max(high, glm::dvec3(mean));
  }
  const glm::dvec3 size = high - low;
  const double extent = std::max({size.x, size.y, size.z, 1e-30});
  std::vector<std::pair<std::uint64_t, std::uint32_t>> codes(means.size());
  for (std::size_t i = 0; i < means.size(); ++i) {
    codes[i] = {mortonCode((glm::dvec3(means[i]) - low) / extent), static_cast<std::uint32_t>(i)};
  }
  std::sort(codes.begin(), codes.end());
  std::vector<std::uint32_t> order(means.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = codes[i].second;
  return order;
}

}  // namespace tg
