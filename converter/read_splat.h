// SPDX-License-Identifier: Apache-2.0
// Reads .splat files: 32 bytes a Gaussian, no header, no SH.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "converter/read_model.h"

namespace tg {

constexpr std::size_t kSplatBytes =
    32;  // position and scale as float32 x 3 each, colour and alpha, quaternion in bytes

// Splats without finite numbers are dropped with a warning. Throws Error(cannotRead / badData).
LoadedModel readSplat(const std::filesystem::path& path);
LoadedModel parseSplat(std::span<const std::uint8_t> bytes, const std::string& path);

}  // namespace tg
