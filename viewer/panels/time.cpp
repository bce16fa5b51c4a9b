// SPDX-License-Identifier: Apache-2.0
// What a frame costs.
#include <imgui.h>

#include <algorithm>

#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"

namespace tg {
namespace {

// A bar of the cell's width.
void shareBar(double share) {
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const float width = ImGui::GetContentRegionAvail().x;
  const float line = ImGui::GetTextLineHeight();
  ImDrawList* draw = ImGui::GetWindowDrawList();
  const auto bar = [&](float length, ImU32 color) {
    draw->AddRectFilled({corner.x, corner.y + line * 0.32f}, {corner.x + length, corner.y + line * 0.78f}, color, 2);
  };
  bar(width, ImGui::GetColorU32(ImGuiCol_FrameBg));
  bar(std::max(1.0f, width * static_cast<float>(share)), ImGui::GetColorU32(ImGuiCol_PlotHistogram));
}

void passTimes(const FrameStatistics& statistics) {
  double sum = 0;
  for (const PassTime& pass : statistics.passes) sum += pass.milliseconds;
  ImGui::PushStyleVar(ImGuiStyleVar_CellPadding, {4, 1});
  if (ImGui::BeginTable("passes", 3, ImGuiTableFlags_SizingFixedFit)) {
    ImGui::TableSetupColumn("pass");
    ImGui::TableSetupColumn("ms");
    ImGui::TableSetupColumn("share", ImGuiTableColumnFlags_WidthStretch);
    for (const PassTime& pass : statistics.passes) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(pass.name.c_str());
      ImGui::TableNextColumn();
      ImGui::Text("%.2f ms", pass.milliseconds);
      ImGui::TableNextColumn();
      shareBar(sum > 0 ? pass.milliseconds / sum : 0);
    }
    ImGui::EndTable();
  }
  ImGui::PopStyleVar();
  ImGui::TextDisabled("sum %.2f ms at %d x %d%s", sum, statistics.picture_size.x, statistics.picture_size.y,
                      statistics.reduced ? ", moving" : "");
}

}  // namespace

void timeSection(ViewerState& state, const FrameStatistics& statistics) {
  heading("TIME");
  if (!statistics.frame_ms.empty()) {
    const float last = statistics.frame_ms.back();
    const float worst = *std::max_element(statistics.frame_ms.begin(), statistics.frame_ms.end());
    ImGui::SameLine();
    ImGui::Text("%.1f ms, %.0f / s", last, last > 0 ? 1000.0f / last : 0.0f);
    ImGui::PlotLines("##frames", statistics.frame_ms.data(), static_cast<int>(statistics.frame_ms.size()), 0, nullptr,
                     0.0f, worst * 1.1f, {ImGui::GetContentRegionAvail().x, ImGui::GetFontSize() * 2});
    hint("Wall time of the last frames");
  }
  if (!statistics.passes.empty()) passTimes(statistics);
  auto percent = static_cast<float>(100 * state.display.resolution);
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
  if (slider("##resolution", percent, 100 * kMinResolution, 100 * kMaxResolution, "Resolution %.0f %%")) {
    state.display.resolution = percent / 100;
  }
  hint("Of the picture, against the window's pixels");
  ImGui::Checkbox("Draw without pause", &state.ui.continuous);
  hint("Otherwise a frame is drawn only when something changes");
  ImGui::TextDisabled("%s", statistics.device.c_str());
}

}  // namespace tg
