// SPDX-License-Identifier: Apache-2.0
// One pair of functions per image file format, behind core/image/image.h. Private to core.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/image/image.h"

namespace tg {

// Throws Error(badData) unless 1 <= width * height <= kMaxImagePixels and the file is long enough to hold them: no
// coder accepted here stores more than `max_ratio` bytes of pixels in one byte of file, but WebP's of a picture that is
// nearly of one colour. Small images always pass.
void checkImageSize(std::int64_t width, std::int64_t height, std::int64_t bytes_per_pixel, std::size_t file_bytes,
                    std::int64_t max_ratio, const std::string& path);

Image decodePng(std::span<const std::uint8_t> bytes, const std::string& path);
Image decodeJpeg(std::span<const std::uint8_t> bytes, const std::string& path);
// 3 channels, or 4 where the file says that it has alpha. Of an animation: Error(badData).
Image decodeWebpPicture(std::span<const std::uint8_t> bytes, const std::string& path);
// Throws Error(cannotWrite), as encodeExrPicture does. `drawn`: with the mark of core/image/drawn.h.
std::vector<std::uint8_t> encodeJpeg(const Image& image, int quality, bool drawn, const std::string& path);

// Any RGB, RGBA or Y picture; A is premultiplied in EXR files and is divided out.
Image decodeExrPicture(std::span<const std::uint8_t> bytes, const std::string& path);
std::vector<std::uint8_t> encodeExrPicture(const Image& image, const std::string& path);

struct ExrInfo {
  int width = 0;
  int height = 0;
  std::vector<std::string> channels;  // in file order: sorted by name
};
// Reads and checks the header alone.
ExrInfo readExrInfo(std::span<const std::uint8_t> bytes, const std::string& path);

}  // namespace tg
