// SPDX-License-Identifier: Apache-2.0
// The renderer of runs without a window.
#pragma once
#include <memory>

#include "render/vulkan/vulkan_renderer.h"
#include "viewer/options.h"

namespace tg {

// A renderer with the device it lives on; the device is destroyed last.
struct HeadlessRenderer {
  std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> device{nullptr, [](VulkanDevice*) {}};
  std::unique_ptr<Renderer> renderer;
};

// What --backend, --device and --validation ask for; says so on stderr when it must be the CPU for want of Vulkan.
// Throws Error(device).
HeadlessRenderer makeHeadlessRenderer(const ViewOptions& options);
// The model's warnings, a line each, to stderr.
void printWarnings(const Scene& scene, const ViewOptions& options);
// Throws Error(device) when the validation layer has said anything.
void requireNoValidationMessages(const HeadlessRenderer& backend);

}  // namespace tg
