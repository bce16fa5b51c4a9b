// SPDX-License-Identifier: Apache-2.0
// GLFW.
#include "viewer/window/glfw.h"

#include <cstdlib>
#include <string>
#include <utility>

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

InputEvent& add(GLFWwindow* window, InputEvent::Kind kind, int code) {
  Events& events = eventsOf(window);
  InputEvent& event = events.waiting.emplace_back();
  event.kind = kind;
  event.code = code;
  event.time = glfwGetTime();
  event.pointer = events.pointer;
  if (events.queued) event.place = events.handled + static_cast<std::uint64_t>(events.queued());
  return event;
}

// Alt and Super are the window system's. A chord is told by the letter that the keyboard's layout has there.
void onKey(GLFWwindow* window, int key, int scancode, int action, int mods) {
  if (action != GLFW_PRESS || (mods & (GLFW_MOD_ALT | GLFW_MOD_SUPER))) return;
  const bool control = (mods & GLFW_MOD_CONTROL) != 0;
  if (control) eventsOf(window).chord = key;
  if (control && key >= GLFW_KEY_A && key <= GLFW_KEY_Z) {
    const char* letter = glfwGetKeyName(key, scancode);
    if (letter && letter[0] >= 'a' && letter[0] <= 'z' && !letter[1]) key = letter[0] - 'a' + GLFW_KEY_A;
  }
  if (key >= GLFW_KEY_LEFT_SHIFT && key <= GLFW_KEY_RIGHT_SUPER) return;  // are told with what they change
  InputEvent& event = add(window, InputEvent::Kind::key, control ? key | kControl : key);
  event.shift = (mods & GLFW_MOD_SHIFT) != 0;
}

void onCharacter(GLFWwindow* window, unsigned code) {
  add(window, InputEvent::Kind::character, static_cast<int>(code));
}

// Of Shift, Ctrl and Alt, which GLFW does not tell with the wheel.
int modsHeld(GLFWwindow* window) {
  const auto held = [window](int left, int right, int mod) {
    return glfwGetKey(window, left) == GLFW_PRESS || glfwGetKey(window, right) == GLFW_PRESS ? mod : 0;
  };
  return held(GLFW_KEY_LEFT_SHIFT, GLFW_KEY_RIGHT_SHIFT, GLFW_MOD_SHIFT) |
         held(GLFW_KEY_LEFT_CONTROL, GLFW_KEY_RIGHT_CONTROL, GLFW_MOD_CONTROL) |
         held(GLFW_KEY_LEFT_ALT, GLFW_KEY_RIGHT_ALT, GLFW_MOD_ALT);
}

// What is turned in a row is one. Dear ImGui hears of it by its own callback, too, which the frame overrules.
void onScroll(GLFWwindow* window, double x, double y) {
  constexpr double kSamePlace = 8;  // units of the window: a hand that turns moves the pointer a little
  Events& events = eventsOf(window);
  const int mods = modsHeld(window);
  const auto goesOn = [&](const InputEvent& last) {
    if (last.kind != InputEvent::Kind::wheel || last.mods != mods) return false;
    if (!last.pointer || !events.pointer) return !last.pointer && !events.pointer;
    return glm::distance(*last.pointer, *events.pointer) < kSamePlace;
  };
  const bool goes_on = !events.waiting.empty() && goesOn(events.waiting.back());
  InputEvent& event = goes_on ? events.waiting.back() : add(window, InputEvent::Kind::wheel, 0);
  event.mods = mods;
  event.wheel += glm::dvec2(x, y);
}

void onMove(GLFWwindow* window, double x, double y) { eventsOf(window).pointer = {x, y}; }

void onEnter(GLFWwindow* window, int entered) {
  if (entered == GLFW_FALSE) eventsOf(window).pointer.reset();
}

void onButton(GLFWwindow* window, int button, int action, int mods) {
  const auto kind = action == GLFW_PRESS ? InputEvent::Kind::press : InputEvent::Kind::release;
  InputEvent& event = add(window, kind, button);
  event.mods = mods;
  if (event.pointer) return;
  event.pointer.emplace();
  glfwGetCursorPos(window, &event.pointer->x, &event.pointer->y);
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

void takeInput(Events& events) {
  // A key of a character comes right before it; those of the keypad may have none.
  const auto isLetter = [&waiting = events.waiting] {
    const InputEvent& event = waiting.front();
    if (event.kind == InputEvent::Kind::character) return true;
    if (event.kind != InputEvent::Kind::key || event.code >= kControl) return false;
    return event.code < GLFW_KEY_ESCAPE || (waiting.size() > 1 && waiting[1].kind == InputEvent::Kind::character);
  };
  const bool same_key =
      !events.taken.empty() && !events.waiting.empty() && events.taken.back().kind == InputEvent::Kind::key &&
      events.waiting.front().kind == InputEvent::Kind::key && events.taken.back().code == events.waiting.front().code;
  events.taken.clear();
  if (same_key) return;  // it is up between
  if (!events.waiting.empty() && events.waiting.front().kind == InputEvent::Kind::release &&
      events.waiting.front().pointer != events.told) {
    return;
  }
  while (!events.waiting.empty()) {
    const bool letter = isLetter();
    if (!letter && !events.taken.empty()) return;
    events.taken.push_back(std::move(events.waiting.front()));
    events.waiting.pop_front();
    if (!letter) return;
  }
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
  glfwSetCharCallback(window.get(), onCharacter);
  glfwSetCursorPosCallback(window.get(), onMove);
  glfwSetCursorEnterCallback(window.get(), onEnter);
  glfwSetMouseButtonCallback(window.get(), onButton);
  glfwSetScrollCallback(window.get(), onScroll);
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
