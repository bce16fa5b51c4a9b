// SPDX-License-Identifier: Apache-2.0
// --render: model in, one image out.
#include "viewer/headless.h"

#include <cstdio>

#include "core/error.h"
#include "render/vulkan/vulkan_renderer.h"
#include "viewer/follow.h"

namespace tg {
namespace {

using VulkanDevicePtr = std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)>;

// A renderer with the device it lives on; the device is destroyed last.
struct HeadlessRenderer {
  VulkanDevicePtr device{nullptr, [](VulkanDevice*) {}};
  std::unique_ptr<Renderer> renderer;
};

HeadlessRenderer makeRenderer(const ViewOptions& options) {
  HeadlessRenderer result;
  const bool asked = !options.device.empty() || options.validation;  // for Vulkan, in other words
  if (options.backend != Backend::cpu) {
    try {
      VulkanOptions vulkan;
      vulkan.validation = options.validation;
      vulkan.device = options.device;
      result.device = createVulkanDevice(vulkan);
      const bool software = result.device->properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
      if (!software || options.backend == Backend::vulkan || asked) {
        result.renderer = makeVulkanRenderer(*result.device);
        return result;
      }
    } catch (const Error& error) {
      if (options.backend == Backend::vulkan || asked) throw;
      std::fprintf(stderr, "tgview: no Vulkan (%s); rendering on the CPU\n", error.what());
    }
    result.device.reset();
  }
  result.renderer = makeCpuRenderer();
  return result;
}

// Before any work: a wrong name must not cost a rendering. True for numbers, false for a picture.
bool writesNumbers(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".exr") return true;
  if (extension == ".png" || extension == ".jpg") return false;
  throw Error(ErrorKind::usage, path.string(),
              "unknown image format (expected .png, .jpg or .exr, found \"" + extension + "\")");
}

void render(const LoadedModel& loaded, const ViewOptions& options, bool numbers, const HeadlessRenderer& backend) {
  for (const std::string& warning : loaded.warnings) {
    std::fprintf(stderr, "%s: warning: %s\n", options.model.c_str(), warning.c_str());
  }
  const Scene scene = describe(loaded, options.model);
  const Camera camera = cameraFor(options, scene);
  RenderSettings settings;
  settings.textures = options.textures;
  settings.intersection = options.intersection;
  settings.background = options.background.value_or(loaded.background);

  backend.renderer->setModel(loaded.model);
  const Frame frame = backend.renderer->render(camera, settings);
  if (backend.device && !backend.device->validation_messages.empty()) {
    throw Error(ErrorKind::device,
                std::to_string(backend.device->validation_messages.size()) + " validation messages (expected none)");
  }
  writeImage(options.out, numbers ? extract(frame, options.show) : visualize(frame, options.show));

  double milliseconds = 0;
  for (const PassTime& pass : backend.renderer->passTimes()) milliseconds += pass.milliseconds;
  std::printf("%s: %dx%d, %s, textures %s, %zu Gaussians, %.1f ms on %s%s\n", options.out.c_str(), frame.width,
              frame.height, std::string(name(options.show)).c_str(),
              options.textures == TextureMode::none ? "off" : std::string(name(options.textures)).c_str(),
              loaded.model.size(), milliseconds, backend.renderer->deviceName().c_str(),
              options.follow && !scene.training.empty() ? (", " + scene.training).c_str() : "");
}

// Every model that comes, until one is the last of its training.
void followToFile(const ViewOptions& options, bool numbers) {
  ModelFollower follower(options.model, [] {});
  const HeadlessRenderer backend = makeRenderer(options);
  for (;;) {
    const ModelFollower::News news = follower.wait();
    if (!news.problem.empty()) std::fprintf(stderr, "tgview: %s\n", news.problem.c_str());
    if (!news.model) continue;
    render(*news.model, options, numbers, backend);
    std::fflush(stdout);
    if (trainingProgress(news.model->training_json).finished) return;
  }
}

}  // namespace

void renderToFile(const ViewOptions& options) {
  const bool numbers = writesNumbers(options.out);
  if (options.follow) return followToFile(options, numbers);
  const LoadedModel loaded = readModel(options.model);
  render(loaded, options, numbers, makeRenderer(options));
}

}  // namespace tg
