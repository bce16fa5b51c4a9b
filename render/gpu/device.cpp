// SPDX-License-Identifier: Apache-2.0
// Sizes that every API rounds up alike, and pixels on their way to the host.
#include "render/gpu/device.h"

#include <algorithm>
#include <bit>

#include "core/system/assert.h"
#include "core/system/parallel.h"

namespace tg {

std::uint64_t bufferBytes(std::uint64_t bytes) { return std::max<std::uint64_t>((bytes + 15) / 16, 1) * 16; }

std::uint64_t allocatedBytes(std::uint64_t bytes) {
  std::uint64_t room = bufferBytes(bytes);
  if ((room & 0xFF00u) == 0) room += 0x100;
  return std::has_single_bit(room) ? room + 16 : room;
}

std::uint32_t allocatedSide(std::uint32_t side, std::uint32_t most) {
  TG_ASSERT(side <= most, "the device's images are as large");
  return std::has_single_bit(side) && side < most ? side + 1 : side;
}

Image imageFromRgba8(std::span<const std::byte> pixels, int width, int height) {
  TG_ASSERT(pixels.size() >= std::size_t{4} * static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
            "four bytes a pixel");
  Image image(width, height, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = static_cast<float>(std::to_integer<int>(pixels[i / 3 * 4 + i % 3])) / 255.0f;
  }
  return image;
}

void toRgba8(const Image& image, std::span<std::byte> pixels) {
  TG_ASSERT(image.channels == 3 && hasImageShape(image), "a picture of 3 channels");
  TG_ASSERT(pixels.size() >= image.data.size() / 3 * 4, "four bytes a pixel");
  parallelFor(image.height, 16, [&](std::int64_t y) {
    const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width);
    for (std::size_t i = row; i < row + static_cast<std::size_t>(image.width); ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        pixels[i * 4 + c] = static_cast<std::byte>(image.data[i * 3 + c] * 255.0f + 0.5f);
      }
      pixels[i * 4 + 3] = std::byte{255};
    }
  });
}

}  // namespace tg
