// SPDX-License-Identifier: Apache-2.0
#include "textured_gaussians/image.h"

#include <algorithm>
#include <cmath>

#include "core/image/image.h"
#include "core/system/lower_case.h"
#include "library/access.h"

namespace textured_gaussians {
namespace {

// Throws tg::Error(usage).
void requireShape(const Image& image, const std::string& name) {
  if (image.width >= 1 && image.height >= 1 && isChannels(image.channels) &&
      image.data.size() == lengthOf(image.width, image.height, image.channels)) {
    return;
  }
  throw tg::Error(tg::ErrorKind::usage, name,
                  "no picture (expected width x height x 1, 3 or 4 numbers, found " +
                      std::to_string(image.data.size()) + " for " + std::to_string(image.width) + " x " +
                      std::to_string(image.height) + " x " + std::to_string(image.channels) + ")");
}

// Of pictures in 8 bits, which have no such numbers. Throws tg::Error(usage).
void requireFinite(const Image& image, const std::string& name) {
  const auto found = std::ranges::find_if(image.data, [](float value) { return !std::isfinite(value); });
  if (found == image.data.end()) return;
  const std::int64_t pixel = (found - image.data.begin()) / image.channels;
  throw tg::Error(tg::ErrorKind::usage, name,
                  "8 bits hold finite numbers alone (found " + std::string(std::isnan(*found) ? "nan" : "inf") +
                      " at column " + std::to_string(pixel % image.width) + ", row " +
                      std::to_string(pixel / image.width) + ")");
}

}  // namespace

ByteImage toBytes(const Image& image, const std::string& name) {
  return guarded([&] {
    requireShape(image, name);
    requireFinite(image, name);
    ByteImage bytes{image.width, image.height, image.channels, {}};
    constexpr float white = 1 + 0.5f / 255;  // with half a step, since computed colours are rounded
    bytes.above_white = 2 * std::ranges::count_if(image.data, [](float value) { return value > white; }) >
                        std::ssize(image.data) - std::ranges::count(image.data, 0.0f);
    bytes.data.reserve(image.data.size());
    for (const float value : image.data) {
      bytes.data.push_back(static_cast<std::uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255.0f + 0.5f));
    }
    return bytes;
  });
}

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
    requireShape(image, path.string());
    const std::string extension = tg::lowerExtension(path);
    if (extension == ".png" || extension == ".jpg" || extension == ".jpeg") requireFinite(image, path.string());
    tg::Image copy;
    copy.width = image.width;
    copy.height = image.height;
    copy.channels = image.channels;
    copy.data = image.data;
    tg::writeImage(path, copy);
  });
}

}  // namespace textured_gaussians
