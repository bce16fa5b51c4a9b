// SPDX-License-Identifier: Apache-2.0
// Chooses between Vulkan and the CPU.
#include "viewer/headless_renderer.h"

#include <cstdio>

#include "core/error.h"

namespace tg {

HeadlessRenderer makeHeadlessRenderer(const ViewOptions& options) {
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

void printWarnings(const Scene& scene, const ViewOptions& options) {
  for (const std::string& warning : scene.warnings) {
    std::fprintf(stderr, "%s: warning: %s\n", options.model.c_str(), warning.c_str());
  }
}

void requireNoValidationMessages(const HeadlessRenderer& backend) {
  if (backend.device && !backend.device->validation_messages.empty()) {
    throw Error(ErrorKind::device,
                std::to_string(backend.device->validation_messages.size()) + " validation messages (expected none)");
  }
}

}  // namespace tg
