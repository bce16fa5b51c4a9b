// SPDX-License-Identifier: Apache-2.0
#include "vulkan_device.h"

#include <cstdio>

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

}  // namespace

VulkanDevice& vulkanDevice() {
  static const auto device = createTestDevice();
  return *device;
}

VulkanRenderer& vulkanRenderer() {
  static const auto renderer = makeVulkanRenderer(vulkanDevice());
  return *renderer;
}

std::string validationMessages() {
  std::string text;
  for (const std::string& message : vulkanDevice().validation_messages) text += message + "\n";
  vulkanDevice().validation_messages.clear();
  return text;
}

}  // namespace tg::test
