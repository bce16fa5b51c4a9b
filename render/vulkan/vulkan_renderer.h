// SPDX-License-Identifier: Apache-2.0
// The Vulkan backend: compute passes, headless or into a window's command buffer.
#pragma once
#include <vulkan/vulkan.h>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "render/renderer.h"

namespace tg {

struct VulkanOptions {
  bool validation = false;                          // Khronos + synchronization validation, where installed
  std::vector<const char*> instance_extensions;     // a window adds its surface extensions
  bool swapchain = false;                           // enable VK_KHR_swapchain and pick a device that can present
  std::function<VkSurfaceKHR(VkInstance)> surface;  // called once when `swapchain`
  std::string device;                               // part of a device's name; empty: the fastest kind there is
};

// Instance, device, and queues of one family that does compute, graphics and transfer. Owns its handles.
struct VulkanDevice {
  VkInstance instance = VK_NULL_HANDLE;
  VkSurfaceKHR surface = VK_NULL_HANDLE;
  VkPhysicalDevice physical = VK_NULL_HANDLE;
  VkDevice device = VK_NULL_HANDLE;
  std::uint32_t queue_family = 0;
  VkQueue queue = VK_NULL_HANDLE;         // what renderers submit to
  VkQueue window_queue = VK_NULL_HANDLE;  // what a window submits and presents to; `queue` where there is only one
  VkPhysicalDeviceProperties properties{};
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

// One frame of the live viewer, recorded into the caller's command buffer.
struct VulkanFrameRequest {
  Camera camera;
  RenderSettings settings;
  Output output = Output::final;  // settings.outputs does not count
  float exposure_stops = 0.0f;    // as of visualize()
};

// How the passes are cut, by kind of device. Pictures do not depend on it.
struct VulkanTuning {
  bool runs = false;             // sorts walk runs of items, one per thread, instead of groups working together
  bool bounded_loops = false;    // a thread's loops must stay below 65535 rounds in all
  std::uint32_t blend_side = 4;  // [px] of the square that a thread of blend draws: 1, 2 or 4
};
VulkanTuning tuningFor(const VulkanDevice& device);

// What the device counted in the last finished frame.
struct VulkanFrameCounts {
  std::uint32_t visible = 0;  // splats that reach the screen
  std::uint32_t pairs = 0;    // (tile, splat)
};

class VulkanRenderer : public Renderer {
 public:
  // Records all passes of a frame; afterwards the visualised output lies in image() in layout GENERAL, written by
  // compute. No read-back, no wait. Must not be called again before the previous recording has finished executing.
  virtual void record(VkCommandBuffer commands, const VulkanFrameRequest& request) = 0;
  // RGBA8, width x height of the last request; usage TRANSFER_SRC | STORAGE. Changes when the size changes.
  virtual VkImage image() const = 0;
  // Call after the fence of the last recording: collects timestamps; false when the pair buffer overflowed, the picture
  // is incomplete and the buffers have been grown for the next frame.
  virtual bool finishFrame() = 0;
  virtual VulkanFrameCounts counts() const { return {}; }
  virtual const VulkanDevice& device() const = 0;
};

// `device` must outlive the renderer.
std::unique_ptr<VulkanRenderer> makeVulkanRenderer(VulkanDevice& device);
std::unique_ptr<VulkanRenderer> makeVulkanRenderer(VulkanDevice& device, const VulkanTuning& tuning);

}  // namespace tg
