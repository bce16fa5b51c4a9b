// SPDX-License-Identifier: Apache-2.0
// Specialization of GLSL text, for drivers that do not load SPIR-V.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace tg {

// constants[i] becomes the value of constant_id i, or the size of a group along x where local_size_x_id says i. Others
// keep their values. `text` has gone through the preprocessor.
std::string specialized(std::string_view text, std::span<const std::uint32_t> constants);

}  // namespace tg
