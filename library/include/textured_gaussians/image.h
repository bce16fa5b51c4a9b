// SPDX-License-Identifier: Apache-2.0
// Pictures as floats, and as bytes.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace textured_gaussians {

struct Image {
  int width = 0;            // [px]
  int height = 0;           // [px]
  int channels = 0;         // 1, 3 (RGB) or 4 (RGB and straight alpha)
  std::vector<float> data;  // [height, width, channels], top row first; colours as stored (sRGB), black 0, white 1
};

// The same in 8 bits a channel, 0 to 255.
struct ByteImage {
  int width = 0;                   // [px]
  int height = 0;                  // [px]
  int channels = 0;                // 1, 3 (RGB) or 4 (RGB and straight alpha)
  std::vector<std::uint8_t> data;  // [height, width, channels], top row first
  bool above_white = false;        // toBytes() found most values but zeros above 1, white, by over half a step
};

// Clamped to [0, 1] and rounded, as in a .png that writeImage() writes. Throws Error(usage), which begins with `name`,
// for numbers that are not finite, and for data that is not as long as the shape says.
ByteImage toBytes(const Image& image, const std::string& name = "image");

// PNG, JPEG, WebP or EXR, told apart by their first bytes. A regular file. Throws Error: cannotRead, badData.
Image readImage(const std::filesystem::path& path);
// By the extension: .png (clamped to [0, 1], 8 bits), .jpg (the same, quality 95, without the alpha of 4 channels) or
// .exr (half floats). A file that is there is replaced once the new one is complete. Throws Error: cannotWrite; usage
// for another extension, for data that is not as long as the shape says, and for numbers that are not finite where 8
// bits are to hold them.
void writeImage(const std::filesystem::path& path, const Image& image);

}  // namespace textured_gaussians
