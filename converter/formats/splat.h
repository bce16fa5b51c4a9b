// SPDX-License-Identifier: Apache-2.0
// .splat files, which most viewers in browsers open: 32 bytes a Gaussian, no header, no SH.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/bundle/bundle.h"

namespace tg {

// Splats without finite numbers are dropped with a warning. Throws Error(cannotRead / badData).
Bundle readSplat(const std::filesystem::path& path);
Bundle parseSplat(std::span<const std::uint8_t> bytes, const std::string& path);

// What the numbers of a .splat could not hold.
struct SplatReport {
  std::size_t clipped_colors = 0;  // splats whose base colour leaves [0, 1]
  std::size_t clipped_scales = 0;  // as clipsScale() has them
};

// Without textures: bake them first (core/model/fallback.h). In the model's order and axes; same model in, same
// bytes out.
std::vector<std::uint8_t> formatSplat(const GaussianModel& model, SplatReport& report);
// Atomic. Throws Error(cannotWrite), Error(badData) for a model without Gaussians.
SplatReport writeSplat(const std::filesystem::path& path, const GaussianModel& model);

}  // namespace tg
