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

void Gui::beginFrame([[maybe_unused]] const Events& events) {
  if (fonts_.stale()) {
    screen_.stopPanels();
    fonts_.load();
    screen_.startPanels();
  }
  screen_.beginPanels();
#if IMGUI_VERSION_NUM < 18700  // later ones queue events themselves
  ImGuiIO& io = ImGui::GetIO();
  // The back end asks where the pointer is by now: a button going up before that would drag on to there.
  if (events.pointer && ImGui::IsMousePosValid()) {
    const glm::vec2 at(*events.pointer);
    io.MousePos = {at.x, at.y};
  }
  for (const int key : std::exchange(held_down_, {})) io.KeysDown[key] = glfwGetKey(window_, key) == GLFW_PRESS;
  io.KeyCtrl = io.KeysDown[GLFW_KEY_LEFT_CONTROL] || io.KeysDown[GLFW_KEY_RIGHT_CONTROL];
  if (events.alt_up) io.KeysDown[GLFW_KEY_LEFT_ALT] = io.KeysDown[GLFW_KEY_RIGHT_ALT] = io.KeyAlt = false;
  io.KeyShift = io.KeysDown[GLFW_KEY_LEFT_SHIFT] || io.KeysDown[GLFW_KEY_RIGHT_SHIFT];
  for (const auto& [pressed, shift] : events.keys) {
    const int key = pressed & ~kControl;
    io.KeyCtrl = io.KeyCtrl || key != pressed;
    io.KeyShift = io.KeyShift || shift;
    if (key < 0 || key >= IM_ARRAYSIZE(io.KeysDown) || io.KeysDown[key]) continue;
    io.KeysDown[key] = true;
    held_down_.push_back(key);
  }
#endif
  ImGui::NewFrame();
}

bool Gui::inputQueued() const {
#if IMGUI_VERSION_NUM < 18700
  return false;
#else
  return !ImGui::GetCurrentContext()->InputEventsQueue.empty();
#endif
}

void Gui::endFrame() { ImGui::Render(); }

}  // namespace tg
