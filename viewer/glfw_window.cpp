// SPDX-License-Identifier: Apache-2.0
// GLFW.
#include "viewer/glfw_window.h"

#include <cstdlib>
#include <string>

#include "core/error.h"

namespace tg {
namespace {

[[noreturn]] void refuseWindow(const std::string& reason) {
  throw Error(ErrorKind::device, "cannot open a window: " + reason + " (--render OUT.png needs none)");
}

std::string lastError() {
  const char* text = nullptr;
  glfwGetError(&text);
  return text ? text : "unknown GLFW error";
}

Events& eventsOf(GLFWwindow* window) { return *static_cast<Events*>(glfwGetWindowUserPointer(window)); }

void onKey(GLFWwindow* window, int key, int, int action, int mods) {
  if (action == GLFW_PRESS) eventsOf(window).keys.emplace_back(key, (mods & GLFW_MOD_SHIFT) != 0);
}

void onDrop(GLFWwindow* window, int count, const char** paths) {
  for (int i = 0; i < count; ++i) eventsOf(window).dropped.emplace_back(paths[i]);
}

}  // namespace

Glfw::Glfw() {
#if defined(__linux__)
  // Asked before GLFW is touched: its own message names neither variable nor way out.
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY")) {
    refuseWindow("no display (expected DISPLAY or WAYLAND_DISPLAY to be set)");
  }
#endif
  if (!glfwInit()) refuseWindow(lastError());
}

WindowPtr openWindow(glm::ivec2 size, Events& events) {
  if (!glfwVulkanSupported()) refuseWindow("GLFW finds no Vulkan loader");
  glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
  WindowPtr window(glfwCreateWindow(size.x, size.y, "tgview", nullptr, nullptr));
  if (!window) refuseWindow(lastError());
  glfwSetWindowUserPointer(window.get(), &events);
  glfwSetKeyCallback(window.get(), onKey);
  glfwSetDropCallback(window.get(), onDrop);
  return window;
}

std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> createWindowDevice(GLFWwindow* window, const ViewOptions& view) {
  VulkanOptions options;
  options.validation = view.validation;
  options.device = view.device;
  std::uint32_t count = 0;
  const char** extensions = glfwGetRequiredInstanceExtensions(&count);
  if (!extensions) refuseWindow("Vulkan cannot draw to this display");
  options.instance_extensions.assign(extensions, extensions + count);
  options.swapchain = true;
  options.surface = [window](VkInstance instance) {
    VkSurfaceKHR surface = VK_NULL_HANDLE;
    if (glfwCreateWindowSurface(instance, window, nullptr, &surface) != VK_SUCCESS) refuseWindow(lastError());
    return surface;
  };
  return createVulkanDevice(options);
}

}  // namespace tg
