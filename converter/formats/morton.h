// SPDX-License-Identifier: Apache-2.0
// Places in space as one number: what is near on the curve is near in space.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace tg {

// p in [0, 1]^3 on a space-filling curve: 21 bits an axis, interleaved.
std::uint64_t mortonCode(glm::dvec3 p);

// The indices of `means` (finite, at least one) along the curve over a cube around them; equal places keep their order.
std::vector<std::uint32_t> mortonOrder(std::span<const glm::vec3> means);

}  // namespace tg
