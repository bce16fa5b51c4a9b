// SPDX-License-Identifier: Apache-2.0
// Places in space as one number: what is near on the curve is near in space.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace tg {

// p in [0, 1]^3 on a space-filling curve: 21 bits an axis, interleaved.
inline std::uint64_t mortonCode(glm::dvec3 p) {
  constexpr int bits = 21;
  const glm::dvec3 scaled = glm::clamp(p, 0.0, 1.0) * static_cast<double>((1 << bits) - 1);
  std::uint64_t code = 0;
  for (int bit = bits - 1; bit >= 0; --bit) {
    for (int k = 0; k < 3; ++k) code = code << 1 | (static_cast<std::uint64_t>(scaled[k]) >> bit & 1);
  }
  return code;
}

// The places of `points`, which are not none, on that curve through the cube around them, from first to last; those in
// one place as they stand.
std::vector<std::uint32_t> mortonOrder(std::span<const glm::vec3> points);

}  // namespace tg
