// SPDX-License-Identifier: Apache-2.0
// Comparing: with what, how, and the numbers.
#include <imgui.h>

#include <array>
#include <cmath>
#include <string>

#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"
#include "viewer/view/actions.h"

namespace tg {
namespace {

void chooseOther(ViewerState& state) {
  CompareState& compare = state.compare;
  const std::vector<Document>& open = state.documents.open;
  const auto label = [&](int document) { return open[document].path.filename().string(); };
  const bool photographs = !compare.photographs.empty();
  const int other = otherDocument(state);
  const std::string preview = compare.with_photographs ? "photographs" : other >= 0 ? label(other) : "nothing";
  ImGui::SetNextItemWidth(-1);
  const float room = ImGui::CalcItemWidth() - ImGui::GetFrameHeight() - 2 * ImGui::GetStyle().FramePadding.x;
  if (!ImGui::BeginCombo("##other", cutMiddle(preview, room).c_str())) return;
  if (photographs && ImGui::Selectable("photographs", compare.with_photographs)) compare.with_photographs = true;
  for (int i = 0; i < static_cast<int>(open.size()); ++i) {
    if (i == state.documents.shown) continue;
    ImGui::PushID(i);
    if (ImGui::Selectable(label(i).c_str(), !compare.with_photographs && i == other)) {
      compare.with_photographs = false;
      compare.other = open[i].path;
    }
    ImGui::PopID();
  }
  ImGui::EndCombo();
}

void modeControls(CompareState& compare) {
  Comparison& how = compare.how;
  switch (how.mode) {
    case CompareMode::wipe:
      ImGui::SetNextItemWidth(-1);
      slider("##divider", how.divider, 0.0f, 1.0f, "Divider %.2f");
      hint("Or drag the line in the picture");
      break;
    case CompareMode::flicker: {
      auto seconds = static_cast<float>(compare.flicker_seconds);
      ImGui::Checkbox("Timed", &compare.timed);
      ImGui::SameLine();
      ImGui::SetNextItemWidth(-1);
      if (slider("##seconds", seconds, static_cast<float>(kFastestFlicker), static_cast<float>(kSlowestFlicker),
                 "%.1f s each")) {
        compare.flicker_seconds = seconds;
      }
      hint("Shift+V shows the other one at any time");
      break;
    }
    case CompareMode::difference:
      ImGui::Checkbox("Signed", &how.with_sign);
      hint("Grey is equal; brighter where the other one is brighter");
      ImGui::SameLine();
      ImGui::SetNextItemWidth(-1);
      slider("##gain", how.gain, 1.0f, kMaxGain, "Gain %.1f", ImGuiSliderFlags_Logarithmic);
      break;
    default:
      ImGui::Dummy({0, ImGui::GetFrameHeight()});
      break;
  }
}

// Grey while they are those of a model or settings before.
void figures(const ViewerState& state) {
  const CompareState& compare = state.compare;
  const PictureMetrics& metrics = *compare.metrics;
  const bool of_colors = !compare.with_photographs && kNumberOutputs.has(state.display.output);
  if (!compare.measured) ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
  ImGui::BeginGroup();
  ImGui::Text(of_colors ? "Colours %.2f dB" : "PSNR %.2f dB", metrics.psnr);
  ImGui::SameLine();
  ImGui::Text("SSIM %.4f", metrics.ssim);
  ImGui::SameLine();
  ImGui::Text("FLIP %.4f", metrics.flip);
  ImGui::EndGroup();
  if (!compare.measured) ImGui::PopStyleColor();
  const std::string size = std::to_string(compare.measured_size.x) + " x " + std::to_string(compare.measured_size.y);
  std::string words = compare.with_photographs ? "Of the photograph at " + size + ", whatever the window shows of it"
                      : of_colors              ? "Of the colours of this view, the other ones being the truth"
                                               : "Of this view, " + size + ", the other one being the truth";
  if (!compare.measured) words += "; measuring: these are of the model or the settings before";
  hint(words.c_str());
}

// A line, whatever it says.
void result(const ViewerState& state) {
  const CompareState& compare = state.compare;
  if (compare.how.mode == CompareMode::off) {
    ImGui::NewLine();
  } else if (!compare.problem.empty()) {
    ImGui::TextColored(kWarningText, "%s", cutMiddle(compare.problem, ImGui::GetContentRegionAvail().x).c_str());
    hint((compare.problem + (compare.way_out.empty() ? "" : "\n") + compare.way_out).c_str());
  } else if (compare.with_photographs && !kPhotographOutputs.has(state.display.output)) {
    ImGui::TextDisabled("no figures: photographs have final and base");
  } else if (isIsolated(state)) {
    ImGui::TextDisabled("no figures of one Gaussian alone");
  } else if (compare.metrics) {
    figures(state);
  } else {
    ImGui::TextDisabled(compare.measured ? "no pixel in common" : "measuring");
  }
}

}  // namespace

void compareSection(ViewerState& state) {
  CompareState& compare = state.compare;
  if (state.documents.open.size() < 2 && compare.photographs.empty()) return;
  constexpr std::array<std::pair<const char*, const char*>, kCount<CompareMode>> labels = {{
      {"Off", "V steps through these"},
      {"Side", "Beside each other"},
      {"Wipe", "Left and right of a line"},
      {"Flicker", "One after the other"},
      {"Difference", "How far they are apart"},
      {"FLIP", "How far they are apart for the eye, when one flips between them"},
  }};
  heading("COMPARE");
  chooseOther(state);
  if (compare.with_photographs && compare.photographs_have_lens) {
    ImGui::PushTextWrapPos();
    ImGui::TextColored(kWarningText, "%s", kLensNote);
    ImGui::PopTextWrapPos();
  }
  for (int i = 0; i < static_cast<int>(labels.size()); ++i) {
    const auto mode = static_cast<CompareMode>(i);
    if (segment(labels[static_cast<std::size_t>(i)].first, compare.how.mode == mode, i % 3, 3)) {
      compare.how.mode = mode;
    }
    hint(labels[static_cast<std::size_t>(i)].second);
  }
  // All modes are of one height: what lies below stays under the pointer that steps through them.
  modeControls(compare);
  result(state);
}

}  // namespace tg
