// SPDX-License-Identifier: Apache-2.0
// The menu bar: what keys do, as a list to read and to click.
#include <imgui.h>
#include <imgui_internal.h>

#include <string>

#include "core/system/error.h"
#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"
#include "viewer/view/actions.h"

namespace tg {
namespace {

void actions(ViewerState& state, Menu menu) {
  for (const KeyBinding& binding : keyBindings()) {
    if (binding.menu != menu || !*binding.text) continue;
    if (binding.begins_group) ImGui::Separator();
    // These two name what they would do.
    const bool steps = binding.run == undo || binding.run == redo;
    const std::string step = !steps ? "" : binding.run == undo ? undoName(state) : redoName(state);
    const std::string label = binding.text + (step.empty() ? "" : ": " + step) + "###" + binding.text;
    if (ImGui::MenuItem(label.c_str(), binding.keys, false, canRun(state, binding))) runAction(state, binding);
  }
}

void recentMenu(ViewerState& state) {
  if (!ImGui::BeginMenu("Open recent", !state.recent.empty())) return;
  recentModels(state, [](const char* label) { return ImGui::MenuItem(label); });
  ImGui::Separator();
  if (ImGui::MenuItem("Forget these")) state.recent.clear();
  ImGui::EndMenu();
}

// A button in the bar that opens a list. Lists are as high as the window allows.
bool beginMenu(const char* label) {
  ImGui::SetNextWindowSizeConstraints({0, 0}, {1e6f, ImGui::GetIO().DisplaySize.y - 2 * ImGui::GetFontSize()});
  return ImGui::BeginMenu(label);
}

void items(ViewerState& state) {
  if (beginMenu("File")) {
    recentMenu(state);
    actions(state, Menu::file);
    ImGui::EndMenu();
  }
  if (beginMenu("Edit")) {
    actions(state, Menu::edit);
    ImGui::EndMenu();
  }
  if (beginMenu("View")) {
    if (beginMenu("Show")) {
      actions(state, Menu::output);
      ImGui::EndMenu();
    }
    actions(state, Menu::view);
    ImGui::EndMenu();
  }
  if (beginMenu("Camera")) {
    actions(state, Menu::camera);
    ImGui::Separator();
    if (ImGui::MenuItem("Save the bookmarks as", nullptr, false, !state.camera.bookmarks.empty())) {
      state.desktop.wanted = FileUse::saveBookmarks;
    }
    ImGui::EndMenu();
  }
  if (beginMenu("Path")) {
    actions(state, Menu::path);
    ImGui::Separator();
    if (ImGui::MenuItem("Save the path as", nullptr, false, !state.path.path.keys.empty())) {
      state.desktop.wanted = FileUse::savePath;
    }
    ImGui::EndMenu();
  }
  if (beginMenu("Help")) {
    actions(state, Menu::help);
    ImGui::TextDisabled("tgview %s", TG_VERSION);
    ImGui::EndMenu();
  }
}

}  // namespace

void panelMenu(ViewerState& state) {
  if (!ImGui::BeginMenuBar()) return;
  items(state);
  ImGui::EndMenuBar();
}

void hiddenMenu(ViewerState& state) {
  const ImGuiIO& io = ImGui::GetIO();
  const float height = ImGui::GetFrameHeight();
  const bool at_top = io.MousePos.y >= 0 && io.MousePos.y < (state.ui.menu ? height : height / 2);
  const bool across = io.MousePos.x >= 0 && io.MousePos.x < io.DisplaySize.x;
  const bool dragging = io.MouseDown[0] || io.MouseDown[1] || io.MouseDown[2];
  state.ui.menu = (at_top && across && (state.ui.menu || !dragging)) || (state.ui.menu && popupIsOpen());
  if (!state.ui.menu || !ImGui::BeginMainMenuBar()) return;
  items(state);
  ImGui::EndMainMenuBar();
}

bool isFading() {
  const float ratio = ImGui::GetCurrentContext()->DimBgRatio;
  return (ratio > 0 && ratio < 1) || hintIsDue();
}

bool closeInnermostList() {
  const ImGuiContext& context = *ImGui::GetCurrentContext();
  const int open = context.OpenPopupStack.Size;
  if (open == 0) return false;
  const ImGuiWindow* top = context.OpenPopupStack[open - 1].Window;
  if (top && (top->Flags & ImGuiWindowFlags_Modal)) return false;
  ImGui::ClosePopupToLevel(open - 1, true);
  return true;
}

}  // namespace tg
