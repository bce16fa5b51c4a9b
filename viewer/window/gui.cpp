// SPDX-License-Identifier: Apache-2.0
// Dear ImGui set-up. Written for 1.86 (Debian 12); the guards are for later releases.
#include "viewer/window/gui.h"

#include <GLFW/glfw3.h>
#include <imgui.h>
#include <imgui_internal.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "viewer/view/actions.h"
#include "viewer/window/glfw.h"

namespace tg {
namespace {

// How much larger than 96 dpi the user wants things, in ImGui's units (which some window systems scale themselves).
float interfaceScale(GLFWwindow* window) {
  float scale = 1, y = 1;
  glfwGetWindowContentScale(window, &scale, &y);
  int units = 1, pixels = 1, ignored = 0;
  glfwGetWindowSize(window, &units, &ignored);
  glfwGetFramebufferSize(window, &pixels, &ignored);
  if (units > 0 && pixels > 0) scale *= static_cast<float>(units) / static_cast<float>(pixels);
  return std::clamp(scale, 1.0f, 4.0f);
}

ImVec4 rgb(int hex, float alpha = 1.0f) {
  return {static_cast<float>(hex >> 16 & 255) / 255.0f, static_cast<float>(hex >> 8 & 255) / 255.0f,
          static_cast<float>(hex & 255) / 255.0f, alpha};
}

void applyStyle(float scale) {
  ImGui::StyleColorsDark();
  ImGuiStyle& style = ImGui::GetStyle();
  style.WindowPadding = {14, 10};
  style.FramePadding = {8, 3};
  style.ItemSpacing = {6, 5};
  style.ItemInnerSpacing = {6, 4};
  style.FrameRounding = 4;
  style.WindowRounding = 6;
  style.GrabRounding = 4;
  style.PopupRounding = 4;
  style.ScrollbarSize = 11;
  style.GrabMinSize = 10;
  style.WindowBorderSize = 0;
  ImVec4* colors = style.Colors;
  colors[ImGuiCol_Text] = rgb(0xe6e8eb);
  colors[ImGuiCol_TextDisabled] = rgb(0x8b929c);
  colors[ImGuiCol_WindowBg] = rgb(0x1b1e23);
  colors[ImGuiCol_PopupBg] = rgb(0x22262c);
  colors[ImGuiCol_FrameBg] = rgb(0x2a2f36);
  colors[ImGuiCol_FrameBgHovered] = rgb(0x343b44);
  colors[ImGuiCol_FrameBgActive] = rgb(0x3c4550);
  colors[ImGuiCol_Button] = rgb(0x2a2f36);
  colors[ImGuiCol_ButtonHovered] = rgb(0x3a424d);
  colors[ImGuiCol_ButtonActive] = rgb(0x46505d);
  colors[ImGuiCol_Header] = rgb(0x2f6f9f, 0.55f);
  colors[ImGuiCol_HeaderHovered] = rgb(0x2f6f9f, 0.75f);
  colors[ImGuiCol_HeaderActive] = rgb(0x2f6f9f);
  colors[ImGuiCol_SliderGrab] = rgb(0x2f6f9f);
  colors[ImGuiCol_SliderGrabActive] = rgb(0x3f86b9);
  colors[ImGuiCol_CheckMark] = rgb(0x74b6e4);
  colors[ImGuiCol_PlotLines] = rgb(0x74b6e4);
  colors[ImGuiCol_PlotHistogram] = rgb(0x3f86b9);
  colors[ImGuiCol_Separator] = rgb(0x31363e);
  colors[ImGuiCol_MenuBarBg] = rgb(0x22262c);
  colors[ImGuiCol_ModalWindowDimBg] = rgb(0x000000, 0.5f);
  colors[ImGuiCol_ScrollbarBg] = rgb(0x1b1e23, 0.0f);
  style.ScaleAllSizes(scale);
}

}  // namespace

Gui::Gui(GLFWwindow* window, Screen& screen)
    : window_(window), screen_(screen), scale_(interfaceScale(window)), fonts_(scale_) {
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  ImGui::GetIO().IniFilename = nullptr;  // leaves no file in the user's folder
  fonts_.load();
  applyStyle(scale_);
  try {
    screen_.startPanels();
  } catch (...) {
    end();
    throw;
  }
}

Gui::~Gui() { end(); }

void Gui::end() {
  screen_.stopPanels();
  ImGui::DestroyContext();
}

void Gui::beginFrame(Events& events, bool waits) {
  if (fonts_.stale()) {
    screen_.stopPanels();
    fonts_.load();
    screen_.startPanels();
  }
  screen_.beginPanels();
  newFrame(events, waits);
}

#if IMGUI_VERSION_NUM < 18700

// The back end tells how everything is by now, and Dear ImGui sees one press a frame.
void Gui::newFrame(Events& events, bool waits) {
  waits ? events.taken.clear() : takeInput(events);
  using Kind = InputEvent::Kind;
  ImGuiIO& io = ImGui::GetIO();
  const auto& waiting = events.waiting;
  const auto& taken = events.taken;
  const auto& pointer = !taken.empty()     ? taken.back().pointer
                        : !waiting.empty() ? waiting.front().pointer
                                           : events.pointer;
  events.told = pointer;
  if (pointer && ImGui::IsMousePosValid()) {
    const glm::vec2 at(*pointer);
    io.MousePos = {at.x, at.y};
  }
  for (int button = 0; button < IM_ARRAYSIZE(io.MouseDown); ++button) {
    const auto isOfIt = [button](const InputEvent& event) {
      return (event.kind == Kind::press || event.kind == Kind::release) && event.code == button;
    };
    const auto now = std::ranges::find_if(taken, isOfIt);
    const auto next = std::ranges::find_if(waiting, isOfIt);
    if (now != taken.end()) {
      io.MouseDown[button] = now->kind == Kind::press;
    } else if (next != waiting.end()) {
      io.MouseDown[button] = next->kind == Kind::release;
    }
    if (now == taken.end() || now->kind != Kind::press || button != GLFW_MOUSE_BUTTON_LEFT) continue;
    // Two are a double click by when they were taken up, not by when their frames are.
    const double before = std::exchange(pressed_at_, now->time);
    if (before >= 0) io.MouseClickedTime[button] = ImGui::GetTime() + double{io.DeltaTime} - (now->time - before);
  }
  const auto isKey = [&](int key) { return key >= 0 && key < IM_ARRAYSIZE(io.KeysDown); };
  for (const int key : std::exchange(told_keys_, {})) io.KeysDown[key] = glfwGetKey(window_, key) == GLFW_PRESS;
  const auto tell = [&](const InputEvent& event, bool down) {
    const int key = event.code & ~kControl;
    if (event.kind != Kind::key || !isKey(key) || io.KeysDown[key] == down) return;
    io.KeysDown[key] = down;
    told_keys_.push_back(key);
  };
  io.KeyCtrl = io.KeysDown[GLFW_KEY_LEFT_CONTROL] || io.KeysDown[GLFW_KEY_RIGHT_CONTROL];
  io.KeyShift = io.KeysDown[GLFW_KEY_LEFT_SHIFT] || io.KeysDown[GLFW_KEY_RIGHT_SHIFT];
  io.KeyAlt = io.KeysDown[GLFW_KEY_LEFT_ALT] || io.KeysDown[GLFW_KEY_RIGHT_ALT];
  // The last part of a drag, too, has what is held as the button goes up.
  const InputEvent* event_now = !taken.empty() ? &taken.back() : waiting.empty() ? nullptr : &waiting.front();
  const bool goes_up = event_now && event_now->kind == Kind::release;
  const bool turns = !taken.empty() && taken.back().kind == Kind::wheel;
  if (goes_up || turns || (!taken.empty() && taken.back().kind == Kind::press)) {
    const int mods = event_now->mods;
    io.KeyCtrl = (mods & GLFW_MOD_CONTROL) != 0;
    io.KeyShift = (mods & GLFW_MOD_SHIFT) != 0;
    io.KeyAlt = (mods & GLFW_MOD_ALT) != 0;
    // The window manager may keep the key going up.
    if (!turns && !io.KeyAlt) io.KeysDown[GLFW_KEY_LEFT_ALT] = io.KeysDown[GLFW_KEY_RIGHT_ALT] = false;
  }
  for (const InputEvent& event : waiting) tell(event, false);
  io.InputQueueCharacters.resize(0);
  io.MouseWheel = io.MouseWheelH = 0;
  for (const InputEvent& event : taken) {
    io.MouseWheelH += static_cast<float>(event.wheel.x);
    io.MouseWheel += static_cast<float>(event.wheel.y);
    tell(event, true);
    if (event.kind == Kind::character) io.AddInputCharacter(static_cast<unsigned>(event.code));
    if (event.kind == Kind::character) io.KeyCtrl = false;
    if (event.kind != Kind::key) continue;
    io.KeyCtrl = event.code >= kControl;
    io.KeyShift = event.shift;
  }
  ImGui::NewFrame();
}

bool Gui::inputQueued() const { return false; }

#else  // which queues events itself

// Commands keep step with what it has handled.
void Gui::newFrame(Events& events, bool waits) {
  ImVector<ImGuiInputEvent>& queue = ImGui::GetCurrentContext()->InputEventsQueue;
  events.queued = [] {
    const ImGuiContext* context = ImGui::GetCurrentContext();
    return context ? context->InputEventsQueue.Size : 0;
  };
  ImVector<ImGuiInputEvent> kept;
  if (waits) kept.swap(queue);
  const int before = queue.Size;
  ImGui::NewFrame();
  events.handled += static_cast<std::uint64_t>(before - queue.Size);
  if (waits) kept.swap(queue);
  events.taken.clear();
  while (!waits && !events.waiting.empty() && (queue.empty() || events.waiting.front().place < events.handled)) {
    events.taken.push_back(events.waiting.front());
    events.waiting.pop_front();
  }
}

bool Gui::inputQueued() const { return !ImGui::GetCurrentContext()->InputEventsQueue.empty(); }

#endif

void Gui::endFrame() { ImGui::Render(); }

}  // namespace tg
