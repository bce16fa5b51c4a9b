// SPDX-License-Identifier: Apache-2.0
// Lossless WebP files as containers of bytes: what goes in comes back, the colour of transparent pixels included.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace tg {

constexpr int kMaxWebpSide = 16383;  // [pixels]

struct BytePixels {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> data;  // [height, width, 4], top row first

  BytePixels() = default;
  BytePixels(int w, int h) : width(w), height(h), data(std::size_t{4} * static_cast<std::size_t>(w) * h) {}
  std::size_t size() const { return data.size() / 4; }  // [pixels]
};

struct WebpHeader {
  int width = 0;  // [pixels]
  int height = 0;
  bool lossless = false;
  bool alpha = false;  // false: every pixel is opaque
};
// Reads the header alone: what a decoder would allocate by. Throws Error(badData): no WebP, an animation.
WebpHeader readWebpHeader(std::span<const std::uint8_t> bytes, const std::string& path);

// Lossy files are decoded, too. `expected`: pixels that the caller has room for, of which one colour takes hardly a
// byte. Throws Error(badData): no WebP, an animation, a size that its bytes cannot hold.
BytePixels decodeWebp(std::span<const std::uint8_t> bytes, const std::string& path, std::size_t expected = 0);
// Same pixels in, same bytes out. Sides of 1 to kMaxWebpSide.
std::vector<std::uint8_t> encodeWebp(const BytePixels& pixels);

}  // namespace tg
