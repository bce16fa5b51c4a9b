// SPDX-License-Identifier: Apache-2.0
// The panel beside the picture.
#include "viewer/panels.h"

#include <imgui.h>

#include "viewer/panel_sections.h"

namespace tg {
namespace {

constexpr float kPanelFonts = 21;   // panel width in font heights
constexpr float kNarrowFonts = 46;  // windows below this: the panel lies over the picture

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
  outputSection(state);
  textureSection(state);
  intersectionSection(state);
  cameraSection(state);
  backgroundSection(state);
  timeSection(state, statistics);
  ImGui::End();
}

}  // namespace

float panelWidth(const ViewerState& state, float window_width) {
  const float font = ImGui::GetFontSize();
  return state.ui.panel && window_width >= kNarrowFonts * font ? kPanelFonts * font : 0.0f;
}

bool popupIsOpen() { return ImGui::IsPopupOpen(nullptr, ImGuiPopupFlags_AnyPopupId | ImGuiPopupFlags_AnyPopupLevel); }

void drawPanels(ViewerState& state, const FrameStatistics& statistics) {
  if (state.ui.panel) panel(state, statistics);
  overlays(state);
}

}  // namespace tg
