// SPDX-License-Identifier: Apache-2.0
// The choice of a device for a window, and the layout of comparisons.
#include "viewer/window/graphics.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <utility>

#include "core/system/error.h"
#include "viewer/picture/device.h"
#include "viewer/view/legend.h"

namespace tg {
namespace {

bool hasOpenGlGpu() {
  const std::vector<DeviceInfo> devices = listDevices(Api::opengl);
  return std::any_of(devices.begin(), devices.end(),
                     [](const DeviceInfo& device) { return device.missing.empty() && !device.software; });
}

OpenedScreen open(Api api, glm::ivec2 size, Events& events, const ViewOptions& options, const DevicePick& pick) {
  OpenedScreen opened;
  opened.window = openWindow(api, size, events, options.validation);
#ifdef TG_VULKAN
  if (api == Api::vulkan) opened.screen = makeVulkanScreen(opened.window.get(), options, pick);
#endif
#ifdef TG_OPENGL
  if (api == Api::opengl) opened.screen = makeGlScreen(opened.window.get(), options, pick);
#endif
  if (!opened.screen) throw Error(ErrorKind::device, "this program was built without " + std::string(name(api)));
  const bool gpu = options.backend != Backend::cpu &&
                   (options.backend != Backend::automatic || !pick.any() || !opened.screen->software());
  opened.backend = gpu ? name(api) : "cpu";
  return opened;
}

OpenedScreen openScreen(glm::ivec2 size, Events& events, const ViewOptions& options, const ScreenWrapper& wrap) {
  const DevicePick pick = pickDevice(options.device);
  std::vector<Api> apis = apisFor(options, pick);
  if (apis.empty()) apis.assign(std::begin(kApis), std::end(kApis));
  OpenedScreen found;
  std::string missing;
  for (const Api api : apis) {
    // Good enough to show what the CPU renders, unless OpenGL reaches a GPU.
    if (found.screen && !hasOpenGlGpu()) break;
    try {
      OpenedScreen opened = open(api, size, events, options, pick);
      if (!found.screen || opened.backend != "cpu") {
        found.screen.reset();  // before its window
        found = std::move(opened);
      }
      if (found.backend != "cpu" || options.backend == Backend::cpu) break;
    } catch (const Error& error) {
      if (error.kind != ErrorKind::device) throw;
      missing += (missing.empty() ? "" : "; ") + std::string(error.what());
    }
  }
  if (!found.screen) throw Error(ErrorKind::device, missing);
  if (wrap) found.screen = wrap(std::move(found.screen));
  return found;
}

// Whether `size` is that of the area at another resolution, whose sides were rounded once and cut once.
bool hasShapeOf(PixelRect area, glm::ivec2 size) {
  const auto times = [](int a, int b) { return std::int64_t{a} * b; };
  return std::abs(times(size.x, area.size.y) - times(size.y, area.size.x)) <= 2 * std::max(area.size.x, area.size.y);
}

// A column of the picture, as shares of its width, and where it goes.
PictureBlit column(const std::shared_ptr<const PictureImage>& image, float begin, float end, PixelRect area) {
  if (!hasShapeOf(area, image->size)) area = fittedInto(area, image->size);
  const auto at = [](float share, int width) {
    return static_cast<int>(std::lround(share * static_cast<float>(width)));
  };
  const int from = at(begin, image->size.x), to = at(begin, area.size.x);
  return {image,
          {{from, 0}, {at(end, image->size.x) - from, image->size.y}},
          {{area.origin.x + to, area.origin.y}, {at(end, area.size.x) - to, area.size.y}}};
}

}  // namespace

Graphics::Graphics(glm::ivec2 size, Events& events, const ViewOptions& options, const ScreenWrapper& wrap)
    : opened(openScreen(size, events, options, wrap)),
      gui(window(), screen()),
      pictures([this] { return screen().makePictureDevice(); }, screen().framesInFlight(), opened.backend,
               glfwPostEmptyEvent) {}

PixelRect fittedInto(PixelRect area, glm::ivec2 size) {
  const double scale = std::min(static_cast<double>(area.size.x) / size.x, static_cast<double>(area.size.y) / size.y);
  const glm::ivec2 fitted = glm::max(glm::ivec2(glm::dvec2(size) * scale), glm::ivec2(1));
  return {area.origin + (area.size - fitted) / 2, fitted};
}

std::vector<PictureBlit> layOut(const Picture& picture, const Comparison& how, PixelRect area) {
  const std::shared_ptr<const PictureImage>& first = picture.image;
  const auto whole = [&](const std::shared_ptr<const PictureImage>& image) {
    return std::vector{column(image, 0, 1, area)};
  };
  if (how.mode == CompareMode::side) {
    PixelRect left = area, right = area;
    left.size.x = sideWidth(area.size.x);
    right.origin.x += left.size.x;
    right.size.x = left.size.x;
    std::vector<PictureBlit> blits = {column(first, 0, 1, left)};
    if (picture.other) blits.push_back(column(picture.other, 0, 1, right));
    return blits;
  }
  if (hasLegend(how.mode) && picture.error) return whole(picture.error);
  if (how.mode == CompareMode::flicker && how.shows_other && picture.other) return whole(picture.other);
  if (how.mode != CompareMode::wipe || !picture.other) return whole(first);
  std::vector<PictureBlit> blits = {column(first, 0, how.divider, area), column(picture.other, how.divider, 1, area)};
  std::erase_if(blits, [](const PictureBlit& blit) {
    return blit.from.size.x <= 0 || blit.to.size.x <= 0;  // the divider at the edge
  });
  return blits;
}

}  // namespace tg
