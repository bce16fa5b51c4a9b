// SPDX-License-Identifier: Apache-2.0
// The open models, when there are several.
#include <imgui.h>

#include "viewer/panel_sections.h"
#include "viewer/panel_widgets.h"

namespace tg {

void documentsSection(ViewerState& state) {
  const std::vector<Document>& open = state.documents.open;
  if (open.size() < 2) return;
  const float button = ImGui::GetFrameHeight();
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  for (int i = 0; i < static_cast<int>(open.size()); ++i) {
    ImGui::PushID(i);
    const float width = ImGui::GetContentRegionAvail().x - button - spacing;
    ImGui::AlignTextToFramePadding();
    if (ImGui::Selectable(open[i].path.filename().string().c_str(), i == state.documents.shown, 0, {width, 0})) {
      state.documents.show_request = i;
    }
    hint((open[i].path.string() + "\nPage Up / Page Down step through the open models").c_str());
    ImGui::SameLine(0, spacing);
    if (ImGui::Button("x", {button, 0})) state.documents.close_request = i;
    hint("Close (Delete closes the one shown)");
    ImGui::PopID();
  }
  ImGui::Separator();
}

}  // namespace tg
