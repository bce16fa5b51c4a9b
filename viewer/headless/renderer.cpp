// SPDX-License-Identifier: Apache-2.0
// Chooses between Vulkan, OpenGL and the CPU.
#include "viewer/headless/renderer.h"

#include <cstdio>
#include <utility>
#include <vector>

#include "core/system/error.h"
#include "viewer/picture/device.h"
#include "viewer/view/legend.h"

namespace tg {
namespace {

std::string limitsText(const GpuLimits& limits) {
  return "buffers to " + std::to_string(limits.storage_bytes >> 20) + " MiB, of texels to " +
         std::to_string(limits.texel_elements) + " elements, images to " + std::to_string(limits.image_side) +
         " px a side";
}

}  // namespace

HeadlessRenderer makeHeadlessRenderer(const ViewOptions& options) {
  const DevicePick pick = pickDevice(options.device);
  const bool asked = !pick.any() || options.validation || options.backend != Backend::automatic;
  HeadlessRenderer result;
  std::string missing;
  bool any = false;
  for (const Api api : apisFor(options, pick)) {
    try {
      result.device = openDevice(api, {pick, options.validation});
      any = true;
      if (!result.device->software() || asked) {
        result.renderer = result.device->makeRenderer();
        result.backend = name(api);
        return result;
      }
    } catch (const Error& error) {
      if (error.kind != ErrorKind::device) throw;
      missing += (missing.empty() ? "" : "; ") + std::string(error.what());
    }
    result.device.reset();
  }
  if (!any && !missing.empty()) {
    if (asked) throw Error(ErrorKind::device, missing);
    std::fprintf(stderr, "tgview: no device (%s); rendering on the CPU\n", missing.c_str());
  }
  result.renderer = makeCpuRenderer();
  result.backend = "cpu";
  return result;
}

void printDevices() {
  const std::vector<DeviceInfo> devices = listDevices();
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const DeviceInfo& device = devices[i];
    std::string line = device.api;
    for (const std::string& part : {device.limits.device, device.version}) line += part.empty() ? "" : ", " + part;
    if (device.missing.empty()) {
      line += device.software ? ", on the CPU\n   " : ", on a GPU\n   ";
      line += limitsText(device.limits);
    } else {
      line += device.limits.device.empty() ? ": " : ": not usable, it lacks ";
      line += device.missing;
    }
    std::printf("%zu  %s\n", i, line.c_str());
  }
  std::printf("-  %s: always there, --backend cpu\n", makeCpuRenderer()->deviceName().c_str());
}

Image shownPicture(const Frame& frame, const ViewOptions& options, const RenderSettings& settings) {
  ValueScale scale;
  Image picture = visualize(frame, options.show, settings, &scale);
  const std::optional<Legend> legend = options.legend ? legendOf(options.show, settings, scale) : std::nullopt;
  return legend ? withLegend(std::move(picture), *legend) : picture;
}

Scene readScene(const ViewOptions& options) { return sceneFor(options, readModel(options.model)); }

Scene sceneFor(const ViewOptions& options, Bundle loaded) {
  Scene scene = sceneOf(std::move(loaded), options.model);
  scene.up = upOf(options.up, scene.up);
  for (const std::string& warning : scene.warnings) {
    std::fprintf(stderr, "%s: warning: %s\n", options.model.c_str(), warning.c_str());
  }
  return scene;
}

void requireNoValidationMessages(const HeadlessRenderer& backend) {
  const std::size_t messages = backend.device ? backend.device->messages().size() : 0;
  if (messages > 0) {
    throw Error(ErrorKind::device, std::to_string(messages) + " validation messages (expected none)");
  }
}

}  // namespace tg
