// SPDX-License-Identifier: Apache-2.0
// The device of the tests that every GPU backend shares: Vulkan's.
#include <cstdio>
#include <utility>

#include "gpu_device.h"
#include "render/vulkan/pass_device.h"
#include "render/vulkan/vulkan_renderer.h"

namespace tg::test {
namespace {

std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> createTestDevice() {
  VulkanOptions options;
  options.validation = true;
  auto device = createVulkanDevice(options);
  std::printf("device: %s; %s\n", device->properties.deviceName,
              device->validation ? "validated" : "NOT validated: VK_LAYER_KHRONOS_validation is not installed");
  return device;
}

std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> device(nullptr, nullptr);
std::unique_ptr<GpuRenderer> renderer;

VulkanDevice& vulkanDevice() {
  if (!device) {
    device = createTestDevice();
    endings().emplace_back([] { device.reset(); });
  }
  return *device;
}

}  // namespace

Api testedApi() { return Api::vulkan; }

GpuRenderer& gpuRenderer() {
  if (!renderer) {
    renderer = makeVulkanRenderer(vulkanDevice());
    endings().emplace_back([] { renderer.reset(); });
  }
  return *renderer;
}

std::unique_ptr<GpuRenderer> makeGpuRenderer(const PassTuning& tuning) {
  return makeVulkanRenderer(vulkanDevice(), tuning);
}

std::array<std::unique_ptr<GpuRenderer>, 2> makeSharingRenderers() {
  const auto pipelines = makePipelines(vulkanDevice());
  return {makeVulkanRenderer(vulkanDevice(), pipelines), makeVulkanRenderer(vulkanDevice(), pipelines)};
}

std::unique_ptr<GpuDevice> makePassDevice() {
  return std::make_unique<VulkanPassDevice>(vulkanDevice(), makePipelines(vulkanDevice()));
}

std::string validationMessages() {
  std::string text;
  for (const std::string& message : vulkanDevice().validation_messages) text += message + "\n";
  vulkanDevice().validation_messages.clear();
  return text;
}

Bindings claim(Bindings bindings) {
  VkPhysicalDeviceLimits& limits = vulkanDevice().properties.limits;
  return {std::exchange(limits.maxStorageBufferRange, bindings.bytes),
          std::exchange(limits.maxTexelBufferElements, bindings.texels)};
}

}  // namespace tg::test
