// SPDX-License-Identifier: Apache-2.0
// The panel beside the picture.
#include "viewer/panels/panels.h"

#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"

namespace tg {
namespace {

constexpr float kPictureFonts = 12;  // [font heights] where the panel leaves less it lies over the picture
constexpr float kDragFonts = 25;     // [font heights] that its edge, dragged, leaves of the picture
constexpr float kPageFonts = 16;     // [font heights] where the lines above a page leave less they scroll with it
constexpr float kEdgeFonts = 0.5f;   // [font heights] of the panel's edge, which the pointer takes

// Of the panel [ImGui units], whatever it covers.
float fullWidth(const ViewerState& state) {
  const float font = ImGui::GetFontSize();
  return std::round(std::min(static_cast<float>(state.ui.panel_width) * font, ImGui::GetIO().DisplaySize.x));
}

void tabs(ViewerState& state) {
  constexpr std::array<const char*, kCount<Tab>> labels = {"View", "Camera", "Path", "Inspect", "Edit", "Time"};
  constexpr int kColumns = 3;
  ImGui::Dummy({0, ImGui::GetFontSize() * 0.25f});
  for (const Tab tab : valuesOf<Tab>()) {
    const int i = static_cast<int>(tab);
    if (segment(labels[static_cast<std::size_t>(i)], state.ui.tab == tab, i % kColumns, kColumns)) state.ui.tab = tab;
  }
}

// Drags the panel's width.
void edge(ViewerState& state) {
  const float font = ImGui::GetFontSize(), width = kEdgeFonts * font, top = ImGui::GetFrameHeight();
  ImGui::SetCursorScreenPos({fullWidth(state) - width, top});
  const float bottom = ImGui::GetIO().DisplaySize.y - ImGui::GetStyle().WindowPadding.y;  // below it scrolls
  ImGui::PushClipRect({0, 0}, ImGui::GetIO().DisplaySize, false);  // it lies in the window's padding
  ImGui::InvisibleButton("edge", {width, std::max(bottom - top, 1.0f)});
  const bool held = ImGui::IsItemActive(), reached = held || ImGui::IsItemHovered();
  if (reached) ImGui::SetMouseCursor(ImGuiMouseCursor_ResizeEW);
  if (held && ImGui::IsMouseDragging(0, 0)) {
    const double wanted = (ImGui::GetIO().MousePos.x + width / 2) / font;
    const double room = std::max<double>(ImGui::GetIO().DisplaySize.x / font - kDragFonts, kLeastPanel);
    state.ui.panel_width = std::clamp(wanted, kLeastPanel, std::min(kMostPanel, room));
  }
  if (reached && ImGui::IsMouseDoubleClicked(0)) state.ui.panel_width = kUsualPanel;
  const float right = ImGui::GetItemRectMax().x;
  const ImGuiCol color = held ? ImGuiCol_SliderGrabActive : reached ? ImGuiCol_SliderGrab : ImGuiCol_Separator;
  ImGui::GetWindowDrawList()->AddRectFilled({right - 2, 0}, {right, ImGui::GetIO().DisplaySize.y},
                                            ImGui::GetColorU32(color));
  ImGui::PopClipRect();
}

void panel(ViewerState& state, const FrameStatistics& statistics) {
  const ImGuiIO& io = ImGui::GetIO();
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize({fullWidth(state), io.DisplaySize.y});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0.0f);
  ImGui::Begin("panel", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_MenuBar);
  ImGui::PopStyleVar();
  pushTabStop(false);  // the key is that of textures
  panelMenu(state);
  ImGuiStorage& kept = *ImGui::GetStateStorage();
  const ImGuiID head = ImGui::GetID("head"), was_low = ImGui::GetID("low"), shown = ImGui::GetID("shown page");
  const float left = ImGui::GetContentRegionAvail().y - kept.GetFloat(head);  // by the head of the frame before
  bool low = left < kPageFonts * ImGui::GetFontSize();
  // Widgets of the page change their IDs with it: none that is held or has a list open may.
  if (ImGui::IsAnyItemActive() || popupIsOpen()) low = kept.GetBool(was_low, low);
  kept.SetBool(was_low, low);
  // The head is always in this window: what is open in it, and thus its height, is kept by the window's ID.
  ImGui::BeginChild("all", {0, 0}, false,
                    low ? ImGuiWindowFlags_None : ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse);
  const float top = ImGui::GetCursorPosY();
  documentsSection(state);
  modelSection(state);
  trainingSection(state);
  compareSection(state);
  historySection(state);
  const float above_tabs = ImGui::GetCursorPosY();
  tabs(state);
  kept.SetFloat(head, ImGui::GetCursorPosY() - top);
  if (!low) {
    ImGui::SetScrollY(0);  // of the time when it was low
    ImGui::BeginChild("page");
  }
  ImGui::PushID("page");  // names of the head are free here in any window
  // Another page begins at its top.
  const int page = static_cast<int>(state.ui.tab);
  if (kept.GetInt(shown, page) != page) ImGui::SetScrollY(low ? std::min(ImGui::GetScrollY(), above_tabs) : 0.0f);
  kept.SetInt(shown, page);
  ImGui::BeginDisabled(!state.scene.model);
  switch (state.ui.tab) {
    case Tab::view:
      levelSection(state);
      outputSection(state);
      textureSection(state);
      settingSection(state, "INTERSECTION");
      settingSection(state, "ORDER AND ANTIALIASING");
      scaleSection(state);
      backgroundSection(state);
      cropSection(state);
      break;
    case Tab::camera:
      cameraSection(state);
      motionSection(state);
      bookmarkSection(state);
      break;
    case Tab::path:
      keySection(state);
      pathFileSection(state);
      recordSection(state);
      break;
    case Tab::inspect:
      inspectSection(state);
      break;
    case Tab::edit:
      ImGui::BeginDisabled(!isWhole(state.scene));
      selectSection(state);
      valueSection(state);
      changeSection(state);
      saveSection(state);
      ImGui::EndDisabled();
      break;
    case Tab::time:
      timeSection(state, statistics);
      break;
  }
  ImGui::EndDisabled();
  ImGui::PopID();
  if (!low) ImGui::EndChild();
  ImGui::EndChild();
  edge(state);
  popTabStop();
  ImGui::End();
}

}  // namespace

float panelWidth(const ViewerState& state, float window_width) {
  const float width = fullWidth(state);
  return state.ui.panel && window_width - width >= kPictureFonts * ImGui::GetFontSize() ? width : 0.0f;
}

bool popupIsOpen() { return ImGui::IsPopupOpen(nullptr, ImGuiPopupFlags_AnyPopupId | ImGuiPopupFlags_AnyPopupLevel); }

bool escapePressed() { return ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape), false); }

void drawPanels(ViewerState& state, const FrameStatistics& statistics, bool escape) {
  if (escape && closeInnermostList()) escape = false;
  sceneOverlay(state);
  state.ui.panel ? panel(state, statistics) : hiddenMenu(state);
  overlays(state);
  dialogs(state, escape);
}

}  // namespace tg
