// SPDX-License-Identifier: Apache-2.0
// A run that is followed: how far it is, its curves, and what it is told to do.
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/run/curves.h"
#include "core/system/numbers.h"
#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"

namespace tg {
namespace {

using Lines = std::vector<RunMetrics>;
using Value = std::optional<double> RunMetrics::*;

constexpr ImU32 kCurve = IM_COL32(116, 182, 228, 255), kDots = IM_COL32(240, 163, 91, 255);
constexpr float kPlotFonts = 4.5f;  // height in font heights
constexpr float kDot = 3.5f;        // [ImGui units] radius

void plot(const char* id, const char* title, const char* number, const Lines& lines, Value curve, Value dots) {
  std::vector<double> curve_values, dot_values;
  for (const RunMetrics& line : lines) {
    if (line.*curve) curve_values.push_back(*(line.*curve));
    if (dots && line.*dots) dot_values.push_back(*(line.*dots));
  }
  const auto range = rangeOfCurves(std::move(curve_values), dot_values);
  if (!range) return;
  const auto [low, high] = withRoom(*range);
  const std::vector<double> at = iterationsOfRun(lines);
  const double last = std::max(1.0, *std::max_element(at.begin(), at.end()));
  ImGui::TextDisabled("%s", title);
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const ImVec2 size{ImGui::GetContentRegionAvail().x, kPlotFonts * ImGui::GetFontSize()};
  ImGui::InvisibleButton(id, size);
  ImDrawList* draw = ImGui::GetWindowDrawList();
  draw->AddRectFilled(corner, {corner.x + size.x, corner.y + size.y}, ImGui::GetColorU32(ImGuiCol_FrameBg), 3);
  const auto point = [&](std::size_t i, double value) {
    const double share = (std::clamp(value, low, high) - low) / (high - low);
    return ImVec2(corner.x + kDot + static_cast<float>(at[i] / last) * (size.x - 2 * kDot),
                  corner.y + (1 - static_cast<float>(share)) * size.y);
  };
  std::vector<ImVec2> points;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (!(lines[i].*curve)) continue;
    const ImVec2 next = point(i, *(lines[i].*curve));
    if (points.empty() || next.x >= points.back().x + 0.5f) points.push_back(next);
  }
  draw->AddPolyline(points.data(), static_cast<int>(points.size()), kCurve, 0, 1.5f);
  for (std::size_t i = 0; dots && i < lines.size(); ++i) {
    if (lines[i].*dots) draw->AddCircleFilled(point(i, *(lines[i].*dots)), kDot, kDots);
  }
  const ImU32 grey = ImGui::GetColorU32(ImGuiCol_TextDisabled);
  const float line = ImGui::GetTextLineHeight();
  const std::string top = formatted(number, range->second), bottom = formatted(number, range->first);
  const auto label = [&](ImVec2 place, const std::string& text) {
    const float width = ImGui::CalcTextSize(text.c_str()).x;
    draw->AddRectFilled(place, {place.x + width, place.y + line}, ImGui::GetColorU32(ImGuiCol_FrameBg, 0.8f));
    draw->AddText(place, grey, text.c_str());
  };
  label({corner.x + 4, corner.y + 1}, top);
  label({corner.x + 4, corner.y + size.y - line - 1}, bottom);
  if (!ImGui::IsItemHovered()) return;
  const double share = (ImGui::GetIO().MousePos.x - corner.x - kDot) / (size.x - 2 * kDot);
  std::size_t nearest = 0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].*curve && std::abs(at[i] / last - share) <= std::abs(at[nearest] / last - share)) nearest = i;
  }
  std::string text = lines[nearest].stage + " " + std::to_string(lines[nearest].iteration);
  if (lines[nearest].*curve) text += ": " + formatted(number, *(lines[nearest].*curve));
  hint(text.c_str());
}

void orders(FollowState& follow, RunPhase phase) {
  const float width = (ImGui::GetContentRegionAvail().x - 3 * ImGui::GetStyle().ItemSpacing.x) / 4;
  const auto button = [&](const char* label, const char* help, const RunOrder& order) {
    if (ImGui::Button(label, {width, 0})) tellRun(follow, order);
    hint(help);
  };
  if (phase == RunPhase::paused) {
    button("Go on##run", "The run trains again", {RunCommand::go, 1});
  } else {
    button("Pause##run", "The run waits after its step", {RunCommand::pause, 1});
  }
  ImGui::SameLine();
  button("Step##run", "One iteration, then a pause", {RunCommand::step, 1});
  ImGui::SameLine();
  button("100##run", "A hundred iterations, then a pause", {RunCommand::step, 100});
  ImGui::SameLine();
  button("Stop##run", "The run writes its checkpoint and ends; --resume goes on with it", {RunCommand::stop, 1});
}

}  // namespace

void trainingSection(ViewerState& state) {
  FollowState& follow = state.follow;
  if (!follow.active) return;
  heading("RUN");
  if (follow.status) {
    orders(follow, follow.status->phase);  // above the words, which wrap now and then
    ImGui::TextWrapped("%s", describe(*follow.status).c_str());
    if (follow.status->now.test_psnr) {
      ImGui::TextDisabled("%.2f dB held out, %.1f it/s", *follow.status->now.test_psnr,
                          follow.status->now.per_second.value_or(0));
    }
  } else if (state.scene.training.empty()) {
    ImGui::TextDisabled("no run has said anything yet");
  } else if (follow.told == RunCommand::stop) {
    ImGui::TextWrapped("the run has stopped (tgtrain --resume goes on)");
  }
  if (!follow.lines || follow.lines->empty()) return;
  plot("##psnr", "PSNR; dots: held out", "%.2f dB", *follow.lines, &RunMetrics::train_psnr, &RunMetrics::test_psnr);
  plot("##loss", "loss", "%.4f", *follow.lines, &RunMetrics::loss, nullptr);
}

}  // namespace tg
