// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/device.h"

#include "core/parallel.h"

namespace tg {

Image imageFromRgba8(std::span<const std::byte> pixels, int width, int height) {
  Image image(width, height, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = static_cast<float>(std::to_integer<int>(pixels[i / 3 * 4 + i % 3])) / 255.0f;
  }
  return image;
}

void toRgba8(const Image& image, std::span<std::byte> pixels) {
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
