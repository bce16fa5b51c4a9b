// SPDX-License-Identifier: Apache-2.0
// The Vulkan backend: compute passes, headless or into a window's command buffer.
#pragma once
#include <memory>

#include "render/gpu/gpu_renderer.h"
#include "render/vulkan/vulkan_device.h"

namespace tg {

PassTuning tuningFor(const VulkanDevice& device);

class VulkanRenderer : public GpuRenderer {
 public:
  using GpuRenderer::GpuRenderer;
  // Records all passes of a frame; afterwards the visualised output lies in image() in layout GENERAL, written by
  // compute. No read-back, no wait. While the previous recording executes it may be called once more if
  // sharesProgram(request).
  void record(VkCommandBuffer commands, const FrameRequest& request);
  // RGBA8, width x height of the last request; usage TRANSFER_SRC | STORAGE. Changes when the size changes.
  VkImage image() const;
  // Call after the fence of the oldest recording; returns as draw() does.
  using GpuRenderer::finishFrame;
  using GpuRenderer::frameFits;
  using GpuRenderer::sharesProgram;
};

// What the passes' shaders are compiled to, kept for renderers of one device that one thread uses.
class Pipelines;
std::shared_ptr<Pipelines> makePipelines(const VulkanDevice& device);

// `device` must outlive the renderer.
std::unique_ptr<VulkanRenderer> makeVulkanRenderer(VulkanDevice& device);
std::unique_ptr<VulkanRenderer> makeVulkanRenderer(VulkanDevice& device, const PassTuning& tuning);
// Compiles only what `pipelines` does not have yet.
std::unique_ptr<VulkanRenderer> makeVulkanRenderer(VulkanDevice& device, std::shared_ptr<Pipelines> pipelines);

}  // namespace tg
