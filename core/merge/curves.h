// SPDX-License-Identifier: Apache-2.0
// Who is near whom, by space-filling curves.
#pragma once
#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace tg {

// Indices of `places` [any unit] in the order of two Morton curves over their box, the lower index first where two fall
// together. The second curve is shifted, so that no place lies on a corner of both: what is near in space is near on
// one of them.
std::array<std::vector<std::uint32_t>, 2> curveOrders(std::span<const glm::dvec3> places);

}  // namespace tg
