// SPDX-License-Identifier: Apache-2.0
// Choosing and changing Gaussians, undo and redo, saving.
#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"
#include "viewer/view/edits.h"

namespace tg {
namespace {

constexpr float kHistogramFonts = 5;  // height in font heights

void toolButton(ViewerState& state, const char* label, EditTool tool, const char* help, int index) {
  if (segment(label, state.edit.tool == tool, index, 3)) setTool(state, tool);
  hint(help);
}

void modeButtons(EditState& edit) {
  constexpr std::array<std::pair<const char*, const char*>, kCount<SelectMode>> modes = {{
      {"New", "What is found replaces the selection"},
      {"Add", "Shift, held, does so at any time"},
      {"Subtract", "Ctrl, held, does so at any time"},
      {"Intersect", "Shift and Ctrl, held, do so at any time"},
  }};
  for (int i = 0; i < kCount<SelectMode>; ++i) {
    const auto& [label, help] = modes[static_cast<std::size_t>(i)];
    const auto mode = static_cast<SelectMode>(i);
    if (segment(label, edit.mode == mode, i, kCount<SelectMode>)) edit.mode = mode;
    hint(help);
  }
}

std::string valueText(const SelectValue& value, double stored) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value.logarithmic ? std::pow(10.0, stored) : stored);
  return text;
}

void histogramBars(ViewerState& state, const Histogram& histogram) {
  EditState& edit = state.edit;
  const SelectValue& value = selectValues()[histogram.value];
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const ImVec2 size(ImGui::GetContentRegionAvail().x, ImGui::GetFontSize() * kHistogramFonts);
  ImGui::InvisibleButton("##histogram", size);
  // Exactly the least and the largest value at the ends.
  const auto at = [&](float x) {
    return std::lerp(histogram.low, histogram.high, double{std::clamp((x - corner.x) / size.x, 0.0f, 1.0f)});
  };
  const ImGuiIO& io = ImGui::GetIO();
  const float mouse = io.MousePos.x;
  const bool begins = ImGui::IsItemActivated();
  if (begins) edit.range_before = edit.selection;
  if (ImGui::IsItemActive() && edit.range_before && (begins || io.MouseDelta.x != 0)) {
    chooseRange(state, at(io.MouseClickedPos[0].x), at(mouse), heldMode(edit, io.KeyShift, io.KeyCtrl));
  }
  hint(("Drag over a range to select it: " + valueText(value, at(mouse))).c_str());
  ImDrawList* draw = ImGui::GetWindowDrawList();
  draw->AddRectFilled(corner, {corner.x + size.x, corner.y + size.y}, ImGui::GetColorU32(ImGuiCol_FrameBg), 4);
  const float width = size.x / static_cast<float>(histogram.bars.size());
  for (std::size_t i = 0; i < histogram.bars.size(); ++i) {
    const float left = corner.x + width * static_cast<float>(i);
    const float high = histogram.bars[i] > 0 ? std::max(histogram.bars[i] * (size.y - 6), 1.0f) : 0.0f;
    draw->AddRectFilled({left, corner.y + size.y - high}, {left + width - 1, corner.y + size.y},
                        ImGui::GetColorU32(ImGuiCol_PlotHistogram));
  }
  if (rangeHolds(edit)) {
    const double pixels = static_cast<double>(size.x) / (histogram.high - histogram.low);
    const auto x = [&](double v) { return corner.x + static_cast<float>((v - histogram.low) * pixels); };
    draw->AddRectFilled({x(edit.low), corner.y}, {x(edit.high) + 1, corner.y + size.y}, IM_COL32(255, 190, 60, 70));
    ImGui::Text("%s to %s", valueText(value, edit.low).c_str(), valueText(value, edit.high).c_str());
  } else {
    ImGui::TextDisabled("%s to %s", valueText(value, histogram.low).c_str(), valueText(value, histogram.high).c_str());
  }
}

}  // namespace

void historySection(ViewerState& state) {
  const std::string back = undoName(state), again = redoName(state);
  ImGui::BeginDisabled(back.empty());
  if (segment((back.empty() ? "Undo###undo" : "Undo " + back + "###undo").c_str(), false, 0, 2)) undo(state);
  ImGui::EndDisabled();
  hint(("Ctrl+Z: undo " + back).c_str());
  ImGui::BeginDisabled(again.empty());
  if (segment((again.empty() ? "Redo###redo" : "Redo " + again + "###redo").c_str(), false, 1, 2)) redo(state);
  ImGui::EndDisabled();
  hint(("Ctrl+Y, Ctrl+Shift+Z: redo " + again).c_str());
}

void selectSection(ViewerState& state) {
  EditState& edit = state.edit;
  heading("SELECT");
  toolButton(state, "Rectangle", EditTool::rectangle, "Drag one over the picture (F2); Esc puts the tool down", 0);
  toolButton(state, "Brush", EditTool::brush, "Drag it over the picture (F3); the wheel changes its radius", 1);
  toolButton(state, "Sphere", EditTool::sphere,
             "A click sets its middle on the surface under the pointer (F4); the wheel changes its radius", 2);
  modeButtons(edit);
  if (segment("All", false, 0, 3)) chooseAll(state);
  hint("Ctrl+A");
  if (segment("None", false, 1, 3)) chooseNone(state);
  hint("Ctrl+Shift+A");
  if (segment("Invert", false, 2, 3)) invertChoice(state);
  hint("Ctrl+I");
  ImGui::Checkbox("Visible only", &edit.visible_only);
  hint("Rectangle and brush leave alone what lies hidden behind others");
  const auto radius = [](const char* id, double& value, double low, double high, const char* format) {
    auto shown = static_cast<float>(value);
    ImGui::SameLine();
    ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
    if (slider(id, shown, static_cast<float>(low), static_cast<float>(high), format, ImGuiSliderFlags_Logarithmic)) {
      value = shown;
    }
  };
  if (edit.tool == EditTool::brush) radius("##brush", edit.brush, kMinBrush, kMaxBrush, "Radius %.0f px");
  if (edit.tool == EditTool::sphere) radius("##sphere", edit.sphere, 1e-3, 10, "Radius %.3f");
  if (edit.selection) {
    ImGui::TextColored(kHighlightText, "%s of %s selected", grouped(edit.selection->count).c_str(),
                       grouped(state.scene.gaussians).c_str());
  } else {
    ImGui::TextDisabled("nothing selected");
  }
}

void valueSection(ViewerState& state) {
  EditState& edit = state.edit;
  heading("SELECT BY VALUE");
  const auto values = selectValues();
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (segment(values[i].label, edit.value == i, static_cast<int>(i), static_cast<int>(values.size()))) edit.value = i;
    hint(values[i].help);
  }
  if (const Histogram* histogram = isWhole(state.scene) ? histogramShown(state) : nullptr) {
    histogramBars(state, *histogram);
  }
}

void changeSection(ViewerState& state) {
  EditState& edit = state.edit;
  heading("CHANGE");
  toolButton(state, "Move", EditTool::move, "Drag an arrow, or the square (F5); without a selection the whole model",
             0);
  toolButton(state, "Turn", EditTool::turn, "Drag a ring (F6); SH turns along", 1);
  toolButton(state, "Scale", EditTool::scale, "Drag the ring (F7)", 2);
  const bool moves = edit.tool == EditTool::move, turns = edit.tool == EditTool::turn;
  if (!edit.selection && (moves || turns || edit.tool == EditTool::scale)) {
    ImGui::PushStyleColor(ImGuiCol_Text, kWarningText);
    ImGui::TextWrapped("nothing selected: %s the whole model", moves ? "moves" : turns ? "turns" : "scales");
    ImGui::PopStyleColor();
  }
  const auto apply = [&](glm::dvec3 move, glm::dvec3 turn, double scale) {
    attempt(state, [&] { transformChosen(state, similarityOf(state, move, turn, scale)); });
  };
  const auto field = [](glm::dvec3& value, float speed, const char* format) {
    glm::vec3 shown(value);
    if (vectorField("##by", shown, speed, format)) value = shown;
  };
  if (edit.tool == EditTool::move) {
    field(edit.move, 0.002f * static_cast<float>(state.scene.bounds.radius), "%.4f");
    if (segment("Move by this", false, 0, 1)) apply(edit.move, glm::dvec3(0.0), 1);
  } else if (edit.tool == EditTool::turn) {
    field(edit.turn, 0.5f, "%.1f\xc2\xb0");
    if (segment("Turn about x, y, z", false, 0, 1)) apply(glm::dvec3(0.0), edit.turn, 1);
  } else if (edit.tool == EditTool::scale) {
    auto factor = static_cast<float>(edit.scale);
    ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
    if (ImGui::DragFloat("##by", &factor, 0.005f, 0.01f, 100.0f, "x %.3f", ImGuiSliderFlags_AlwaysClamp)) {
      edit.scale = factor;
    }
    if (segment("Scale by this", false, 0, 1)) apply(glm::dvec3(0.0), glm::dvec3(0.0), edit.scale);
  }
  ImGui::BeginDisabled(!edit.selection);
  if (segment("Delete the selection", false, 0, 1)) deleteChosen(state);
  hint("Delete");
  ImGui::EndDisabled();
}

void saveSection(ViewerState& state) {
  heading("SAVE");
  if (segment("Save the model as", false, 0, 1)) state.desktop.wanted = FileUse::saveModel;
  hint("Ctrl+S");
  if (state.desktop.saving) {
    ImGui::TextDisabled("saving ...");
  } else if (state.edit.revision != state.edit.saved) {
    ImGui::TextColored(kWarningText, "edited, not saved");
  }
}

}  // namespace tg
