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
  return text ? text : "GLFW gives no reason (are libglfw.so.3 and libX11.so.6 there?)";
}

Events& eventsOf(GLFWwindow* window) { return *static_cast<Events*>(glfwGetWindowUserPointer(window)); }

// Alt and Super are the window system's. A chord is told by the letter that the keyboard's layout has there.
void onKey(GLFWwindow* window, int key, int scancode, int action, int mods) {
  if (action != GLFW_PRESS || (mods & (GLFW_MOD_ALT | GLFW_MOD_SUPER))) return;
  const bool control = (mods & GLFW_MOD_CONTROL) != 0;
  if (control) eventsOf(window).chord = key;
  if (control && key >= GLFW_KEY_A && key <= GLFW_KEY_Z) {
    const char* letter = glfwGetKeyName(key, scancode);
    if (letter && letter[0] >= 'a' && letter[0] <= 'z' && !letter[1]) key = letter[0] - 'a' + GLFW_KEY_A;
  }
  eventsOf(window).keys.emplace_back(control ? key | kControl : key, (mods & GLFW_MOD_SHIFT) != 0);
}

void onMove(GLFWwindow* window, double x, double y) { eventsOf(window).pointer = {x, y}; }

void onEnter(GLFWwindow* window, int entered) {
  if (entered == GLFW_FALSE) eventsOf(window).pointer.reset();
}

void onButton(GLFWwindow* window, int button, int action, int mods) {
  if ((mods & GLFW_MOD_ALT) == 0) eventsOf(window).alt_up = true;
  if (button != GLFW_MOUSE_BUTTON_LEFT) return;
  if (action != GLFW_PRESS) {
    eventsOf(window).keys_of_drag = eventsOf(window).keys.size();
    return;
  }
  Press press{glfwGetTime(), {}};
  glfwGetCursorPos(window, &press.at.x, &press.at.y);
  press.at = eventsOf(window).pointer.value_or(press.at);
  eventsOf(window).presses.push_back(press);
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
  // As the desktop file has them.
  glfwWindowHintString(GLFW_X11_CLASS_NAME, "tgview");
  glfwWindowHintString(GLFW_X11_INSTANCE_NAME, "tgview");
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
  glfwSetCursorPosCallback(window.get(), onMove);
  glfwSetCursorEnterCallback(window.get(), onEnter);
  glfwSetMouseButtonCallback(window.get(), onButton);
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
