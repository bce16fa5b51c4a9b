// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/device.h"

namespace tg {

Image imageFromRgba8(std::span<const std::byte> pixels, int width, int height) {
  Image image(width, height, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = static_cast<float>(std::to_integer<int>(pixels[i / 3 * 4 + i % 3])) / 255.0f;
  }
  return image;
}

}  // namespace tg
