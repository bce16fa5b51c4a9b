// SPDX-License-Identifier: Apache-2.0
// The panel beside the picture.
#include "viewer/panels/panels.h"

#include <imgui.h>

#include <array>

#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"

namespace tg {
namespace {

constexpr float kPanelFonts = 21;   // panel width in font heights
constexpr float kNarrowFonts = 46;  // windows below this: the panel lies over the picture

void tabs(ViewerState& state) {
  constexpr std::array<const char*, kCount<Tab>> labels = {"View", "Camera", "Path", "Inspect", "Edit", "Time"};
  constexpr int kColumns = 3;
  ImGui::Dummy({0, ImGui::GetFontSize() * 0.25f});
  for (const Tab tab : valuesOf<Tab>()) {
    const int i = static_cast<int>(tab);
    if (segment(labels[static_cast<std::size_t>(i)], state.ui.tab == tab, i % kColumns, kColumns)) state.ui.tab = tab;
  }
}

void panel(ViewerState& state, const FrameStatistics& statistics) {
  const ImGuiIO& io = ImGui::GetIO();
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize({kPanelFonts * ImGui::GetFontSize(), io.DisplaySize.y});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0.0f);
  ImGui::Begin("panel", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoBringToFrontOnFocus);
  ImGui::PopStyleVar();
  documentsSection(state);
  modelSection(state);
  compareSection(state);
  historySection(state);
  tabs(state);
  ImGui::BeginChild("page");
  switch (state.ui.tab) {
    case Tab::view:
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
      selectSection(state);
      valueSection(state);
      changeSection(state);
      saveSection(state);
      break;
    case Tab::time:
      timeSection(state, statistics);
      break;
  }
  ImGui::EndChild();
  ImGui::End();
}

}  // namespace

float panelWidth(const ViewerState& state, float window_width) {
  const float font = ImGui::GetFontSize();
  return state.ui.panel && window_width >= kNarrowFonts * font ? kPanelFonts * font : 0.0f;
}

bool popupIsOpen() { return ImGui::IsPopupOpen(nullptr, ImGuiPopupFlags_AnyPopupId | ImGuiPopupFlags_AnyPopupLevel); }

void drawPanels(ViewerState& state, const FrameStatistics& statistics) {
  sceneOverlay(state);
  if (state.ui.panel) panel(state, statistics);
  overlays(state);
}

}  // namespace tg
