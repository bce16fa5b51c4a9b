// SPDX-License-Identifier: Apache-2.0
// Float images and their files. Values are display-referred as stored: never linearised.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace tg {

struct Image {
  int width = 0;
  int height = 0;
  int channels = 0;         // 1, 3 or 4 (straight alpha last)
  std::vector<float> data;  // [height, width, channels], top row first, 8-bit files map to 0..1

  Image() = default;
  Image(int w, int h, int c, float value = 0.0f)
      : width(w), height(h), channels(c), data(static_cast<std::size_t>(w) * h * c, value) {}
  float& at(int x, int y, int c) { return data[(static_cast<std::size_t>(y) * width + x) * channels + c]; }
  float at(int x, int y, int c) const { return data[(static_cast<std::size_t>(y) * width + x) * channels + c]; }
};

// Whether there is a value for every channel of every pixel.
inline bool hasImageShape(const Image& image) {
  return image.width >= 0 && image.height >= 0 && image.channels >= 0 &&
         image.data.size() == static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height) *
                                  static_cast<std::size_t>(image.channels);
}

constexpr std::int64_t kMaxImagePixels = std::int64_t{1} << 28;  // larger headers are refused before any allocation

// PNG, JPEG, WebP or EXR, told apart by their first bytes. Grey becomes 1 channel, palettes and 16 bit are converted.
// Throws Error(cannotRead / badData), also for what is no regular file.
Image readImage(const std::filesystem::path& path);
Image decodeImage(std::span<const std::uint8_t> bytes, const std::string& path);

// By extension .png (clamped to [0,1], rounded to 8 bit), .jpg (quality 95) or .exr (half, ZIP). Atomic: written to a
// temporary name in the same folder, then renamed. Throws Error(cannotWrite / usage).
void writeImage(const std::filesystem::path& path, const Image& image);
std::vector<std::uint8_t> encodePng(const Image& image);
// 16 bits a channel, clamped to [0, 1]; 1, 3 or 4 channels. Throws Error(cannotWrite).
std::vector<std::uint8_t> encodePng16(const Image& image);

// EXR, half float, ZIP, scan lines, channel names given, one per image channel (for example R G B alpha). `path` starts
// messages.
std::vector<std::uint8_t> encodeExr(const Image& image, std::span<const std::string> channel_names,
                                    const std::string& path = "EXR");
Image decodeExr(std::span<const std::uint8_t> bytes, std::span<const std::string> channel_names,
                const std::string& path);

// Straight alpha over `background` (3 values); 3-channel images pass unchanged.
Image compositeOver(const Image& image, const float background[3]);
// Box-filtered reduction by an integer factor, premultiplied where there is alpha. Edges that fill no box are cut.
Image downsample(const Image& image, int factor);

}  // namespace tg
