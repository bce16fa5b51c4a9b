// SPDX-License-Identifier: Apache-2.0
// The window system: one window, its events, and a Vulkan device that draws into it.
#pragma once
#include <vulkan/vulkan.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "render/vulkan/vulkan_renderer.h"
#include "viewer/options.h"

namespace tg {

// GLFW, from first to last window. Throws Error(device) where there is no display.
class Glfw {
 public:
  Glfw();
  ~Glfw() { glfwTerminate(); }
  Glfw(const Glfw&) = delete;
  Glfw& operator=(const Glfw&) = delete;
};

// What the callbacks collected since the last frame.
struct Events {
  std::vector<std::pair<int, bool>> keys;  // key, shift
  std::vector<std::filesystem::path> dropped;
};

struct WindowCloser {
  void operator()(GLFWwindow* window) const { glfwDestroyWindow(window); }
};
using WindowPtr = std::unique_ptr<GLFWwindow, WindowCloser>;

// `events` must outlive the window. Throws Error(device).
WindowPtr openWindow(glm::ivec2 size, Events& events);
// A device with a surface for the window. Throws Error(device).
std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> createWindowDevice(GLFWwindow* window, const ViewOptions& view);

}  // namespace tg
