// SPDX-License-Identifier: Apache-2.0
// Pictures that these programs drew say so in their files, so that nobody takes them for photographs.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "core/image/image.h"

namespace tg {

// In PNG as text under "Software", in JPEG as a comment. EXR has none: nothing takes it for a photograph.
inline constexpr std::string_view kDrawnBy = "Textured Gaussians";

// As writeImage() and encodePng(), with that mark.
void writeDrawn(const std::filesystem::path& path, const Image& image);
std::vector<std::uint8_t> encodeDrawnPng(const Image& image);

constexpr std::size_t kDrawnBytes = 128;  // of a file's beginning hold the mark
// Whether a file that begins so has it.
bool isDrawn(std::span<const std::uint8_t> start);

}  // namespace tg
