// SPDX-License-Identifier: Apache-2.0
// The models opened before, and the open ones when there are several.
#include <imgui.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "core/system/error.h"
#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"
#include "viewer/view/edits.h"

namespace tg {

constexpr float kNameFonts = 30;  // [font heights] of a name in a list of its own, at most

void recentModels(ViewerState& state, bool (*item)(const char* label)) {
  for (const std::string& path : state.recent) {
    ImGui::PushID(path.c_str());
    const float most = std::min(kNameFonts * ImGui::GetFontSize(), 0.8f * ImGui::GetIO().DisplaySize.x);
    if (item(cutMiddle(printable(std::filesystem::path(path).filename().string()), most).c_str())) {
      state.documents.open_requests.emplace_back(path);
    }
    hint(printable(path).c_str());
    ImGui::PopID();
  }
}

namespace {

void recentList(ViewerState& state) {
  if (state.recent.empty()) return;
  ImGui::SetNextItemWidth(-1);
  if (!ImGui::BeginCombo("##recent", "Recent models")) return;
  recentModels(state, [](const char* label) { return ImGui::Selectable(label); });
  ImGui::EndCombo();
}

}  // namespace

void documentsSection(ViewerState& state) {
  recentList(state);
  const std::vector<Document>& open = state.documents.open;
  if (open.size() < 2) return;
  const float button = ImGui::GetFrameHeight();
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  for (int i = 0; i < static_cast<int>(open.size()); ++i) {
    ImGui::PushID(i);
    const float width = ImGui::GetContentRegionAvail().x - button - spacing;
    ImGui::AlignTextToFramePadding();
    const char* unsaved = hasUnsavedEdits(state, i) ? "*" : "";
    const std::string name =
        cutMiddle(printable(open[i].path.filename().string()), width - ImGui::CalcTextSize(unsaved).x) + unsaved;
    if (ImGui::Selectable(name.c_str(), i == state.documents.shown, 0, {width, 0})) {
      state.documents.show_request = i;
    }
    hint((printable(open[i].path.string()) + (*unsaved ? "\nHas edits that were not saved" : "") +
          "\nPage Up / Page Down step through the open models")
             .c_str());
    ImGui::SameLine(0, spacing);
    if (ImGui::Button("x", {button, 0})) askToClose(state, i);
    hint("Close (Ctrl+W closes the one shown)");
    ImGui::PopID();
  }
  ImGui::Separator();
}

}  // namespace tg
