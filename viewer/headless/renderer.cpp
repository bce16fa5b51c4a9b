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

// What the command line says of it.
void adapt(Scene& scene, const ViewOptions& options) {
  scene.up = upOf(options.up, scene.up);
  for (const std::string& warning : scene.warnings) {
    if (!options.quiet) std::fprintf(stderr, "%s\n", printable(scene.path.string() + ": warning: " + warning).c_str());
  }
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
      if (!result.device->software() || asked) {
        result.renderer = result.device->makeRenderer();
        result.backend = name(api);
        return result;
      }
      any = true;
    } catch (const Error& error) {
      if (error.kind != ErrorKind::device) throw;
      missing += (missing.empty() ? "" : "; ") + std::string(error.what());
    }
    result.device.reset();
  }
  if (!any && !missing.empty()) {
    if (asked) throw Error(ErrorKind::device, missing);
    if (!options.quiet) std::fprintf(stderr, "tgview: no device (%s); rendering on the CPU\n", missing.c_str());
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

ViewedScene::ViewedScene(const ViewOptions& options, const std::filesystem::path& path)
    : budget_(options.splat_budget.value_or(kUsualSplatBudget)) {
  ViewOptions named = options;
  named.model = path;
  if (!isLodMeta(path)) {
    if (options.splat_budget && !isLodMeta(options.model) && !isLodMeta(options.compare)) {
      throw Error(ErrorKind::usage, path.string(), "has no levels for --splat-budget (expected a lod-meta.json)");
    }
    scene_ = sceneFor(named, readModel(path));
    return;
  }
  opened_ = openLevels(path, {});
  resident_.emplace(opened_->scene, opened_->reader, opened_->require_same);
  scene_ = sceneOf(*opened_, resident_->model(), path);
  adapt(scene_, options);
}

std::shared_ptr<const GaussianModel> ViewedScene::modelFor(const Camera& camera) {
  if (!opened_) return scene_.model;
  const std::vector<std::uint8_t> levels = chooseLevels(opened_->scene, camera, budget_);
  if (levels == resident_->levels()) return resident_->model();
  for (const std::uint32_t file : resident_->missing(levels, camera.position())) resident_->read(file, levels);
  resident_->assemble(levels);
  return resident_->model();
}

Scene sceneFor(const ViewOptions& options, Bundle loaded) {
  Scene scene = sceneOf(std::move(loaded), options.model);
  adapt(scene, options);
  return scene;
}

void requireNoValidationMessages(const HeadlessRenderer& backend) {
  const std::size_t messages = backend.device ? backend.device->messages().size() : 0;
  if (messages > 0) {
    throw Error(ErrorKind::device, std::to_string(messages) + " validation messages (expected none)");
  }
}

}  // namespace tg
