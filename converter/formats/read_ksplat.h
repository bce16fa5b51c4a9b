// SPDX-License-Identifier: Apache-2.0
// Reads .ksplat, the format of github.com/mkkellogg/GaussianSplats3D (src/loaders/SplatBuffer.js there): sections of
// splats in floats, in halves, or in halves with SH in 8 bits. docs/formats.md has the layout.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "core/bundle/bundle.h"

namespace tg {

// In the file's order; SH degree 0 to 2, the greatest of the sections'. Splats without finite numbers are dropped with
// a warning. Memory is taken for no more than the file has bytes for. Throws Error(cannotRead / badData).
Bundle readKsplat(const std::filesystem::path& path);
Bundle parseKsplat(std::span<const std::uint8_t> bytes, const std::string& path);

}  // namespace tg
