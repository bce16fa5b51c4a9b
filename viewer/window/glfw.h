// SPDX-License-Identifier: Apache-2.0
// The window system: windows and their events.
#pragma once
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <cstdint>
#include <deque>
#include <filesystem>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
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

// A key or a button going down, a button going up, a character, or the wheel.
struct InputEvent {
  enum class Kind { key, character, press, release, wheel };
  Kind kind = Kind::key;
  int code = 0;           // key, with kControl where it is held; of Unicode; button
  bool shift = false;     // of a key
  int mods = 0;           // of a button and the wheel: GLFW_MOD_SHIFT, CONTROL, ALT as they were held then
  glm::dvec2 wheel{0.0};  // notches, across and up
  double time = -1;       // [s] of GLFW's clock: when it was taken up, which is once a frame
  // Of the window, in its units; none: no event since it left.
  std::optional<glm::dvec2> pointer;
  std::uint64_t place = 0;  // in Dear ImGui's own queue, counted since the window opened
};

// What the callbacks collected.
struct Events {
  std::deque<InputEvent> waiting;  // in the order in which they came
  std::vector<InputEvent> taken;   // by this frame
  int chord = 0;                   // what was pressed last with Ctrl, by its place on the keyboard; 0: nothing
  std::vector<std::filesystem::path> dropped;
  // Where the last event had it, kept from frame to frame. GLFW itself tells where the pointer is by now.
  std::optional<glm::dvec2> pointer;
  std::optional<glm::dvec2> told;  // to the last frame
  // How much Dear ImGui's own queue holds, and what it has handled of it since the window opened. Null: it has none.
  int (*queued)() = nullptr;
  std::uint64_t handled = 0;
};
// Takes what the next frame may have at once, in place of what the one before had: letters and their keys, or one of
// anything else, so that what a key or a button does to the focus is known to whatever comes after it. Nothing between
// two presses of one key, nor before a button goes up elsewhere than `told`: the frame drags to there.
void takeInput(Events& events);

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
