// SPDX-License-Identifier: Apache-2.0
// One validated device for the whole test program: drivers that compile shaders on the CPU take seconds to warm up.
#pragma once
#include "render/vulkan/vulkan_renderer.h"

namespace tg::test {

VulkanDevice& vulkanDevice();
// One renderer on it, with its pipelines.
VulkanRenderer& vulkanRenderer();

// The messages since the last call, one a line: CHECK(validationMessages() == "").
std::string validationMessages();

}  // namespace tg::test
