// SPDX-License-Identifier: Apache-2.0
// Places cut in two at the longer side of the box around them.
#pragma once
#include <algorithm>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>

namespace tg {

struct Box {
  glm::vec3 low{0.0f}, high{0.0f};  // [world units]
};

// Around places[i] for all i of `part`, which are not none.
inline Box boxOf(std::span<const glm::vec3> places, std::span<const std::uint32_t> part) {
  Box box{places[part.front()], places[part.front()]};
  for (const std::uint32_t i : part) {
    box.low = glm::min(box.low, places[i]);
    box.high = glm::max(box.high, places[i]);
  }
  return box;
}

inline Box around(const Box& a, const Box& b) { return {glm::min(a.low, b.low), glm::max(a.high, b.high)}; }

// Orders `part` so that its first `middle` < its size are those that come first along the longest side of the box
// around them; of equal places the lower number is first.
inline void splitAt(std::span<const glm::vec3> places, std::span<std::uint32_t> part, std::size_t middle) {
  const Box box = boxOf(places, part);
  const glm::vec3 sides = box.high - box.low;
  const int axis = sides.x >= sides.y && sides.x >= sides.z ? 0 : sides.y >= sides.z ? 1 : 2;
  std::nth_element(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(middle), part.end(),
                   [&](std::uint32_t a, std::uint32_t b) {
                     return places[a][axis] != places[b][axis] ? places[a][axis] < places[b][axis] : a < b;
                   });
}

}  // namespace tg
