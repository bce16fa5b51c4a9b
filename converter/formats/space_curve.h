// SPDX-License-Identifier: Apache-2.0
// An order of points in which neighbours are near in space: codecs then find differences small.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace tg {

// The place of p in [0, 1]^3 along a Hilbert curve of 21 bits an axis, by Skilling, "Programming the Hilbert curve"
// (2004).
std::uint64_t hilbertCode(glm::dvec3 p);

// The places of `points`, which are not none, on that curve through the cube around them, from first to last; those in
// one place as they stand.
std::vector<std::uint32_t> hilbertOrder(std::span<const glm::vec3> points);

}  // namespace tg
