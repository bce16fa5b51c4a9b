// SPDX-License-Identifier: Apache-2.0
// Instance, device and queues.
#pragma once
#include <vulkan/vulkan.h>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "render/gpu/device.h"

namespace tg {

struct VulkanOptions {
  bool validation = false;                          // Khronos + synchronization validation, where installed
  std::vector<const char*> instance_extensions;     // a window adds its surface extensions
  bool swapchain = false;                           // enable VK_KHR_swapchain and pick a device that can present
  std::function<VkSurfaceKHR(VkInstance)> surface;  // called once when `swapchain`
  std::string device;                               // part of a device's name; empty: the fastest kind there is
  std::optional<std::size_t> index;                 // of listVulkanDevices(); instead of a name
};

// Instance, device, and queues of one family that does compute and transfer, with a surface graphics, too. Owns its
// handles.
struct VulkanDevice {
  VkInstance instance = VK_NULL_HANDLE;
  VkSurfaceKHR surface = VK_NULL_HANDLE;
  VkPhysicalDevice physical = VK_NULL_HANDLE;
  VkDevice device = VK_NULL_HANDLE;
  std::uint32_t queue_family = 0;
  VkQueue queue = VK_NULL_HANDLE;         // what renderers submit to
  VkQueue window_queue = VK_NULL_HANDLE;  // what a window submits and presents to; `queue` where there is only one
  VkPhysicalDeviceProperties properties{};
  // Passes read storage buffers where others read texel buffers: the driver's texel buffers hold too little.
  bool storage_texels = false;
  bool validation = false;                       // the layer is on: asked for and installed
  std::vector<std::string> validation_messages;  // every warning and error, in order; tests demand none

  // Held around every call that takes the queue: renderer and window live in threads of their own.
  std::mutex& mutexOf(VkQueue which) const { return which == queue ? queue_mutex : window_mutex; }
  mutable std::mutex queue_mutex;
  mutable std::mutex window_mutex;
  std::mutex messages_mutex;  // guards validation_messages while more than one thread calls Vulkan
};

// Throws Error(device): no loader, no device, missing feature - with the name of what is missing.
std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> createVulkanDevice(const VulkanOptions& options);

GpuLimits limitsOf(const VkPhysicalDeviceProperties& properties, bool storage_texels);
// Why these limits do not suffice for the passes; "": they do.
std::string whatLimitsLack(const VkPhysicalDeviceLimits& limits);

// Those that createVulkanDevice() chooses from. Throws Error(device) when there is no loader.
std::vector<DeviceInfo> listVulkanDevices();

}  // namespace tg
