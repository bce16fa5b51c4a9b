// SPDX-License-Identifier: Apache-2.0
// The CPU renderer behind the window's interface, for machines whose only Vulkan device is a software one.
#pragma once
#include <memory>

#include "render/vulkan/vulkan_renderer.h"

namespace tg {

// Renders while it records; the picture is copied into image() by the commands. `device` must outlive the renderer.
std::unique_ptr<VulkanRenderer> makeCpuPictureRenderer(VulkanDevice& device);

}  // namespace tg
