// SPDX-License-Identifier: Apache-2.0
#include "textured_gaussians/image.h"

#include "core/image/image.h"
#include "library/access.h"

namespace textured_gaussians {

Image readImage(const std::filesystem::path& path) {
  return guarded([&] {
    requirePath(path);
    tg::Image image = tg::readImage(path);
    return Image{image.width, image.height, image.channels, std::move(image.data)};
  });
}

void writeImage(const std::filesystem::path& path, const Image& image) {
  guarded([&] {
    requirePath(path);
    tg::Image copy;
    copy.width = image.width;
    copy.height = image.height;
    copy.channels = image.channels;
    copy.data = image.data;
    if (image.width < 1 || image.height < 1 || (image.channels != 1 && image.channels != 3 && image.channels != 4) ||
        !tg::hasImageShape(copy)) {
      throw tg::Error(tg::ErrorKind::usage, path.string(),
                      "no picture (expected width x height x 1, 3 or 4 numbers, found " +
                          std::to_string(image.data.size()) + " for " + std::to_string(image.width) + " x " +
                          std::to_string(image.height) + " x " + std::to_string(image.channels) + ")");
    }
    tg::writeImage(path, copy);
  });
}

}  // namespace textured_gaussians
