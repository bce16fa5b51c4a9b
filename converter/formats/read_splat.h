// SPDX-License-Identifier: Apache-2.0
// Reads .splat files: 32 bytes a Gaussian, no header, no SH.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "core/bundle/bundle.h"

namespace tg {

struct SplatFileRow {  // as stored, little endian
  float position[3];
  float scale[3];  // linear
  std::uint8_t color[4];
  std::uint8_t rotation[4];  // w, x, y, z; 128 is 0
};
constexpr std::size_t kSplatBytes = 32;
static_assert(sizeof(SplatFileRow) == kSplatBytes);

// Splats without finite numbers are dropped with a warning. Throws Error(cannotRead / badData).
Bundle readSplat(const std::filesystem::path& path);
Bundle parseSplat(std::span<const std::uint8_t> bytes, const std::string& path);

}  // namespace tg
