// SPDX-License-Identifier: Apache-2.0
// TG_VK(call): every VkResult is looked at, in every build.
#pragma once
#include <vulkan/vulkan.h>

namespace tg {

// Throws Error(device) with the function's and the result's names when `result` is an error. `call` begins with the
// function.
void checkVulkan(VkResult result, const char* call);

}  // namespace tg

#define TG_VK(call) ::tg::checkVulkan((call), #call)
