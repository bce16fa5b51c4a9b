// SPDX-License-Identifier: Apache-2.0
// The window system: windows and their events.
#pragma once
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <filesystem>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "render/devices/devices.h"

namespace tg {

// GLFW, from first to last window. Throws Error(device) where there is no display.
class Glfw {
 public:
  Glfw();
  ~Glfw() { glfwTerminate(); }
  Glfw& operator=(Glfw&&) = delete;
};

// The left button going down.
struct Press {
  double time = -1;    // [s] of GLFW's clock
  glm::dvec2 at{0.0};  // of the window, in its units
};

// What the callbacks collected since the last frame.
struct Events {
  std::vector<Press> presses;
  std::vector<std::pair<int, bool>> keys;  // key (with kControl), shift
  // How many of them came before the left button went up; none: it did not.
  std::optional<std::size_t> keys_of_drag;
  int chord = 0;                           // what was pressed last with Ctrl, by its place on the keyboard; 0: nothing
  bool alt_up = false;                     // when a button went down: the window manager may keep the key going up
  std::vector<std::filesystem::path> dropped;
  // Of the window, in its units, where the last event had it, kept from frame to frame; none: no event since it left.
  // GLFW itself tells where the pointer is by now.
  std::optional<glm::dvec2> pointer;
};

struct WindowCloser {
  void operator()(GLFWwindow* window) const { glfwDestroyWindow(window); }
};
using WindowPtr = std::unique_ptr<GLFWwindow, WindowCloser>;

// For that API; an OpenGL window has a context, which nothing has made current. `events` must outlive the window.
// Throws Error(device).
WindowPtr openWindow(Api api, glm::ivec2 size, Events& events, bool debug);
// A context without a window that shares its objects with the window's. Throws Error(device).
WindowPtr openSharedContext(GLFWwindow* window);

}  // namespace tg
