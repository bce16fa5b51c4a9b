// SPDX-License-Identifier: Apache-2.0
// Devices of windows, and the layout of comparisons.
#include "viewer/graphics.h"

#include <cmath>

namespace tg {
namespace {

bool rendersOnCpu(const VulkanDevice& device, Backend backend) {
  const bool software = device.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
  return backend == Backend::cpu || (backend == Backend::automatic && software);
}

// A column of the picture, as shares of its width, and where it goes.
PictureBlit column(const PictureImage& image, float begin, float end, PixelRect area) {
  const auto at = [](float share, int width) {
    return static_cast<int>(std::lround(share * static_cast<float>(width)));
  };
  const int from = at(begin, image.size.x), to = at(begin, area.size.x);
  return {image.storage.handle(),
          {{from, 0}, {at(end, image.size.x) - from, image.size.y}},
          {{area.origin.x + to, area.origin.y}, {at(end, area.size.x) - to, area.size.y}}};
}

}  // namespace

Graphics::Graphics(GLFWwindow* window, const ViewOptions& options)
    : device(createWindowDevice(window, options)),
      presenter(*device),
      gui(window, *device, presenter),
      pictures(*device, rendersOnCpu(*device, options.backend), glfwPostEmptyEvent) {}

std::vector<PictureBlit> layOut(const Picture& picture, const Comparison& how, PixelRect area) {
  const PictureImage& first = *picture.image;
  const auto whole = [&](const PictureImage& image) { return std::vector{column(image, 0, 1, area)}; };
  if (how.mode == CompareMode::side) {
    PixelRect left = area, right = area;
    left.size.x = sideWidth(area.size.x);
    right.origin.x += left.size.x;
    right.size.x = left.size.x;
    std::vector<PictureBlit> blits = {column(first, 0, 1, left)};
    if (picture.other) blits.push_back(column(*picture.other, 0, 1, right));
    return blits;
  }
  if (how.mode == CompareMode::difference && picture.difference) return whole(*picture.difference);
  if (how.mode == CompareMode::flicker && how.shows_other && picture.other) return whole(*picture.other);
  if (how.mode != CompareMode::wipe || !picture.other) return whole(first);
  std::vector<PictureBlit> blits = {column(first, 0, how.divider, area), column(*picture.other, how.divider, 1, area)};
  std::erase_if(blits, [](const PictureBlit& blit) {
    return blit.from.size.x <= 0 || blit.to.size.x <= 0;  // the divider at the edge
  });
  return blits;
}

}  // namespace tg
