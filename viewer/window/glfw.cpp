// SPDX-License-Identifier: Apache-2.0
// GLFW.
#include "viewer/window/glfw.h"

#include <cstdlib>
#include <string>

#include "core/system/error.h"
#include "viewer/view/actions.h"

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
  if (action != GLFW_PRESS) return;
  const int control = (mods & GLFW_MOD_CONTROL) != 0 ? kControl : 0;
  eventsOf(window).keys.emplace_back(key | control, (mods & GLFW_MOD_SHIFT) != 0);
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

WindowPtr openWindow(Api api, glm::ivec2 size, Events& events, bool debug) {
  glfwDefaultWindowHints();
  if (api == Api::vulkan) {
    if (!glfwVulkanSupported()) refuseWindow("GLFW finds no Vulkan loader");
    glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
  } else {
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_CONTEXT_ROBUSTNESS, GLFW_LOSE_CONTEXT_ON_RESET);
    glfwWindowHint(GLFW_OPENGL_DEBUG_CONTEXT, debug);
    glfwWindowHint(GLFW_DEPTH_BITS, 0);
    glfwWindowHint(GLFW_STENCIL_BITS, 0);
  }
  WindowPtr window(glfwCreateWindow(size.x, size.y, "tgview", nullptr, nullptr));
  if (!window) refuseWindow(lastError());
  glfwSetWindowUserPointer(window.get(), &events);
  glfwSetKeyCallback(window.get(), onKey);
  glfwSetDropCallback(window.get(), onDrop);
  return window;
}

// The hints are still those of the window.
WindowPtr openSharedContext(GLFWwindow* window) {
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  WindowPtr shared(glfwCreateWindow(1, 1, "tgview", nullptr, window));
  glfwWindowHint(GLFW_VISIBLE, GLFW_TRUE);
  if (!shared) refuseWindow(lastError());
  return shared;
}

}  // namespace tg
