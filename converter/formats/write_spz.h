// SPDX-License-Identifier: Apache-2.0
// Writes SPZ version 3, which every SPZ reader since 2025 knows.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/model/model.h"

namespace tg {

// What the 8 bits of a number could not hold.
struct SpzReport {
  int fractional_bits = 0;         // positions are multiples of 2^-fractional_bits
  std::size_t clipped_scales = 0;  // splats with a log scale outside [-10, 5.9375]
  std::size_t clipped_colors = 0;  // splats with a DC coefficient outside +-3.33
  std::size_t clipped_sh = 0;      // splats with a coefficient of degree 1 to 3 outside [-1, 1]
};

// Without textures: bake them first (converter/gltf/fallback.h). Same model in, same bytes out. Throws Error(badData) when a
// mean is too far out for 24 bits; `path` starts the message.
std::vector<std::uint8_t> formatSpz(const GaussianModel& model, const std::string& path, SpzReport& report);
SpzReport writeSpz(const std::filesystem::path& path, const GaussianModel& model);

}  // namespace tg
