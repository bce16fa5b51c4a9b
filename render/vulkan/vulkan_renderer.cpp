// SPDX-License-Identifier: Apache-2.0
// The shared renderer on Vulkan.
#include "render/vulkan/vulkan_renderer.h"

#include "render/vulkan/pass_device.h"

namespace tg {

void VulkanRenderer::record(VkCommandBuffer commands, const FrameRequest& request) {
  const Recording recording = prepareFrame(request);
  static_cast<VulkanProgram&>(recording.program).record(commands, recording.view);
}

VkImage VulkanRenderer::image() const {
  const GpuImage* picture = GpuRenderer::image();
  return picture ? static_cast<const StorageImage*>(picture)->handle() : VK_NULL_HANDLE;
}

PassTuning tuningFor(const VulkanDevice& device) {
  const bool cpu = device.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
  return {cpu, cpu, cpu ? 4u : 2u};
}

std::shared_ptr<Pipelines> makePipelines(const VulkanDevice& device) { return std::make_shared<Pipelines>(device); }

std::unique_ptr<VulkanRenderer> makeVulkanRenderer(VulkanDevice& device) {
  return makeVulkanRenderer(device, makePipelines(device));
}

std::unique_ptr<VulkanRenderer> makeVulkanRenderer(VulkanDevice& device, const PassTuning& tuning) {
  return std::make_unique<VulkanRenderer>(std::make_unique<VulkanPassDevice>(device, makePipelines(device)), tuning);
}

std::unique_ptr<VulkanRenderer> makeVulkanRenderer(VulkanDevice& device, std::shared_ptr<Pipelines> pipelines) {
  return std::make_unique<VulkanRenderer>(std::make_unique<VulkanPassDevice>(device, std::move(pipelines)),
                                          tuningFor(device));
}

}  // namespace tg
