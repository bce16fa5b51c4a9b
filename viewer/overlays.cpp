// SPDX-License-Identifier: Apache-2.0
// Over the picture: the help, errors, and lines that fade.
#include <imgui.h>

#include "viewer/actions.h"
#include "viewer/panel_sections.h"
#include "viewer/panel_widgets.h"

namespace tg {
namespace {

// The middle of the picture, which lies right of the panel.
ImVec2 pictureCenter(const ViewerState& state) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float left = panelWidth(state, size.x);
  return {left + (size.x - left) / 2, size.y / 2};
}

void helpRow(const char* keys, const char* text) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextColored(kHighlightText, "%s", keys);
  ImGui::TableNextColumn();
  ImGui::TextUnformatted(text);
}

void help(ViewerState& state) {
  ImGui::SetNextWindowPos(pictureCenter(state), ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowBgAlpha(0.94f);
  ImGui::Begin("help", nullptr, kOverlay);
  ImGui::TextDisabled("KEYS AND MOUSE");
  if (ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit)) {
    for (const HelpLine& line : mouseHelp()) helpRow(line.keys, line.text);
    for (const KeyBinding& binding : keyBindings()) {
      if (*binding.keys) helpRow(binding.keys, binding.text);
    }
    helpRow("Drop a file", "Open a model, or a cameras.json");
    ImGui::EndTable();
  }
  ImGui::End();
}

void errorPanel(ViewerState& state) {
  ImGui::SetNextWindowPos(pictureCenter(state), ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::Begin("error", nullptr, kOverlay);
  ImGui::TextColored(kErrorText, "This did not work");
  ImGui::PushTextWrapPos(ImGui::GetFontSize() * 32);
  ImGui::TextUnformatted(state.messages.error.c_str());
  ImGui::PopTextWrapPos();
  ImGui::TextDisabled("The view is as it was.");
  if (ImGui::Button("Close")) state.messages.error.clear();
  ImGui::End();
}

// In the middle while --follow has no model yet.
void waiting(const ViewerState& state) {
  ImGui::SetNextWindowPos(pictureCenter(state), ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::Begin("waiting", nullptr, kOverlay);
  ImGui::PushTextWrapPos(ImGui::GetFontSize() * 32);
  ImGui::TextUnformatted(state.follow.problem.c_str());
  ImGui::PopTextWrapPos();
  ImGui::End();
}

void notice(const ViewerState& state) {
  const ImVec2 center = pictureCenter(state);
  const ImVec2 text = ImGui::CalcTextSize(state.messages.notice.c_str());
  const ImVec2 padding = ImGui::GetStyle().WindowPadding;
  ImGui::SetNextWindowPos({center.x, ImGui::GetIO().DisplaySize.y - ImGui::GetFontSize()}, ImGuiCond_Always,
                          {0.5f, 1.0f});
  ImGui::SetNextWindowSize({text.x + 2 * padding.x, text.y + 2 * padding.y});  // auto-sizing lags by a frame
  ImGui::SetNextWindowBgAlpha(0.85f);
  ImGui::Begin("notice", nullptr,
               (kOverlay & ~ImGuiWindowFlags_AlwaysAutoResize) | ImGuiWindowFlags_NoInputs |
                   ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoFocusOnAppearing);
  ImGui::TextUnformatted(state.messages.notice.c_str());
  ImGui::End();
}

}  // namespace

void overlays(ViewerState& state) {
  if (state.ui.help) help(state);
  if (state.follow.active && state.follow.reloads == 0 && !state.follow.problem.empty()) waiting(state);
  if (!state.messages.error.empty()) errorPanel(state);
  if (state.time < state.messages.notice_until) notice(state);
}

}  // namespace tg
