// SPDX-License-Identifier: Apache-2.0
// TG_VK(call): every VkResult is looked at, in every build.
#pragma once
#include <vulkan/vulkan.h>

namespace tg {

// Throws Error(device) with the call's text, the result's name and the place when `result` is an error.
void checkVulkan(VkResult result, const char* call, const char* file, int line);

}  // namespace tg

#define TG_VK(call) ::tg::checkVulkan((call), #call, __FILE__, __LINE__)
