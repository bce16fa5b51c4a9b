// SPDX-License-Identifier: Apache-2.0
// Reads compressed splat PLY, the format of PlayCanvas and SuperSplat: chunks of 256 splats with bounds, 16 bytes a
// splat within them, SH in 8 bit.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/model/model.h"

namespace tg {

constexpr std::size_t kCompressedPlyChunk = 256;  // Gaussians
constexpr float kCompressedPlyShRange = 8.0f;     // the bytes of SH span [-4, 4]

// SH degree 0-3, with or without bounds of colours. Throws Error(cannotRead / badData).
// `warnings`, of what is left out, may be null.
GaussianModel readCompressedPly(const std::filesystem::path& path, std::vector<std::string>* warnings = nullptr);
GaussianModel parseCompressedPly(std::span<const std::uint8_t> bytes, const std::string& path,
                                 std::vector<std::string>* warnings = nullptr);

}  // namespace tg
