// SPDX-License-Identifier: Apache-2.0
// Reads SPZ: versions 2 and 3 (one gzip stream, or that stream's bytes in the clear) and 4 (a Zstandard stream an
// attribute).
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "core/bundle/bundle.h"

namespace tg {

// The numbers as stored: in practice those of the PLY the file was made from (docs/formats.md). Vendor extensions and
// SH of degree 4 are left out with a warning. Throws Error(cannotRead / badData).
Bundle readSpz(const std::filesystem::path& path);
Bundle parseSpz(std::span<const std::uint8_t> bytes, const std::string& path);

}  // namespace tg
