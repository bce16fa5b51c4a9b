// SPDX-License-Identifier: Apache-2.0
// The inspected pixel: its splats front to back, and the one that is picked.
#include <imgui.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/model/verbs.h"

#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"
#include "viewer/view/actions.h"
#include "viewer/view/inspection.h"

namespace tg {
namespace {

constexpr float kChartFonts = 5;   // height of the chart in font heights
constexpr float kListRows = 9;     // of the list before it scrolls
constexpr int kMaxShownSide = 64;  // [texels] larger textures are shown by every second, third, ... texel

ImU32 packed(glm::vec3 color, float alpha = 1.0f) {
  color = glm::clamp(color, 0.0f, 1.0f);
  return ImGui::ColorConvertFloat4ToU32({color.x, color.y, color.z, alpha});
}

// Transmittance over depth as steps, and each splat's alpha as a bar below.
void chart(const ViewerState& state) {
  const std::vector<PixelHit>& hits = state.inspect.hits;
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const ImVec2 size(ImGui::GetContentRegionAvail().x, ImGui::GetFontSize() * kChartFonts);
  ImGui::InvisibleButton("##chart", size);
  hint("Light that is left (line) and alpha (bars) over depth");
  ImDrawList* draw = ImGui::GetWindowDrawList();
  draw->AddRectFilled(corner, {corner.x + size.x, corner.y + size.y}, ImGui::GetColorU32(ImGuiCol_FrameBg), 4);
  // One order for all pixels is not always that of a pixel's depths, by which the line goes.
  std::vector<std::size_t> by_depth(hits.size());
  std::iota(by_depth.begin(), by_depth.end(), std::size_t{0});
  std::stable_sort(by_depth.begin(), by_depth.end(),
                   [&](std::size_t a, std::size_t b) { return hits[a].t < hits[b].t; });
  const double first = hits[by_depth.front()].t, last = std::max(hits[by_depth.back()].t, first + 1e-9);
  const auto x = [&](double t) {
    return corner.x + 4 + static_cast<float>((t - first) / (last - first)) * (size.x - 8);
  };
  const auto y = [&](double value) { return corner.y + 3 + (1 - static_cast<float>(value)) * (size.y - 6); };
  ImVec2 pen(corner.x + 4, y(1));
  double left = 1;
  for (const std::size_t i : by_depth) {
    const PixelHit& hit = hits[i];
    const bool picked = static_cast<int>(i) == state.inspect.picked;
    const ImU32 bar = picked ? ImGui::GetColorU32(kHighlightText) : ImGui::GetColorU32(ImGuiCol_PlotHistogram, 0.6f);
    draw->AddLine({x(hit.t), y(0)}, {x(hit.t), y(hit.alpha)}, bar, picked ? 3.0f : 2.0f);
    left *= 1 - hit.alpha;
    const float after = y(left), next = x(hit.t);
    draw->AddLine(pen, {next, pen.y}, ImGui::GetColorU32(kWarningText), 1.5f);
    draw->AddLine({next, pen.y}, {next, after}, ImGui::GetColorU32(kWarningText), 1.5f);
    pen = {next, after};
  }
  draw->AddLine(pen, {corner.x + size.x - 4, pen.y}, ImGui::GetColorU32(kWarningText), 1.5f);
}

void swatch(glm::vec3 color) {
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const float side = ImGui::GetTextLineHeight();
  ImGui::Dummy({side, side});
  ImGui::GetWindowDrawList()->AddRectFilled(corner, {corner.x + side, corner.y + side}, packed(color), 2);
}

// Of the list, the least important one last: it goes first where there is no room.
struct Column {
  const char* label;
  HitColumn column;
  const char* widest;  // text in it, but for the index, which its model decides
  const char* help;
};
constexpr std::array kColumns = {
    Column{"index", HitColumn::index, "", "Of the Gaussian"},
    Column{"depth", HitColumn::depth, "0.0000", "Camera z of the hit"},
    Column{"weight", HitColumn::weight, "100", "Weight: its share of the pixel, T x alpha [%]"},
    Column{"alpha", HitColumn::alpha, "100", "Alpha: opacity x value x texture, at the hit [%]"},
    Column{"rgb", HitColumn::order, "", "Base colour, and what the texture adds (grey: nothing); sorts front to back"},
    Column{"size", HitColumn::size, "0.000", "Its longest sigma, in world units"},
    Column{"opacity", HitColumn::opacity, "100", "Opacity of the Gaussian [%]"},
};
constexpr float kLeastGap = 6, kMostGap = 18;  // [ImGui units] between columns

// A click sorts by the column, a second one the other way round.
void header(ViewerState& state, std::size_t columns) {
  ImGui::TableNextRow(ImGuiTableRowFlags_Headers);
  for (std::size_t i = 0; i < columns; ++i) {
    const Column& column = kColumns[i];
    ImGui::TableNextColumn();
    const bool sorts = state.inspect.sorted_by == column.column && column.column != HitColumn::order;
    if (sorts) ImGui::PushStyleColor(ImGuiCol_Text, kHighlightText);
    if (ImGui::Selectable(column.label, false, 0, {ImGui::CalcTextSize(column.label).x, 0})) {
      sortHits(state, column.column);
    }
    if (sorts) ImGui::PopStyleColor();
    hint((std::string(column.help) + (sorts ? state.inspect.descending ? ", falling" : ", rising" : "")).c_str());
  }
}

void cell(const GaussianModel& model, const PixelHit& hit, HitColumn column) {
  switch (column) {
    case HitColumn::index:
      break;
    case HitColumn::depth:
      ImGui::Text("%.4g", hit.t);
      break;
    case HitColumn::weight:
      ImGui::Text("%.0f", 100 * hit.weight);
      break;
    case HitColumn::alpha:
      ImGui::Text("%.0f", 100 * hit.alpha);
      break;
    case HitColumn::opacity:
      ImGui::Text("%.0f", 100 * opacityOf(model, hit.index));
      break;
    case HitColumn::size: {
      const glm::dvec3 sigma = sigmaOf(model, hit.index);
      ImGui::Text("%.2g", std::max({sigma.x, sigma.y, sigma.z}));
      break;
    }
    case HitColumn::order:
      swatch(glm::vec3(hit.base));
      ImGui::SameLine(0, 0);
      swatch(0.5f + 0.5f * glm::vec3(hit.texture));
      break;
  }
}

void list(ViewerState& state) {
  const std::vector<PixelHit>& hits = state.inspect.hits;
  const GaussianModel& model = *state.scene.model;
  const std::vector<int> order = sortedHits(model, hits, state.inspect.sorted_by, state.inspect.descending);
  const auto widest = std::ranges::max(hits, {}, &PixelHit::index).index;
  std::array<float, kColumns.size()> widths;
  for (std::size_t i = 0; i < kColumns.size(); ++i) {
    const std::string text = i == 0 ? std::to_string(widest) : kColumns[i].widest;
    const float swatches = kColumns[i].column == HitColumn::order ? 2 * ImGui::GetTextLineHeight() : 0;
    widths[i] = std::max({ImGui::CalcTextSize(kColumns[i].label).x, ImGui::CalcTextSize(text.c_str()).x, swatches});
  }
  const float room = ImGui::GetContentRegionAvail().x - ImGui::GetStyle().ScrollbarSize;
  std::size_t columns = kColumns.size();
  const auto gap = [&] {
    return (room - std::accumulate(widths.begin(), widths.begin() + static_cast<std::ptrdiff_t>(columns), 0.0f)) /
           static_cast<float>(columns);
  };
  while (columns > 1 && gap() < kLeastGap) --columns;
  ImGui::PushStyleVar(ImGuiStyleVar_CellPadding, {std::floor(std::min(gap(), kMostGap) / 2), 1});
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {ImGui::GetStyle().ItemSpacing.x, 2});  // no row reaches into the next
  const float row = ImGui::GetTextLineHeight() + 2;
  const float rows = std::min(static_cast<float>(hits.size()), kListRows);
  if (ImGui::BeginTable("hits", static_cast<int>(columns),
                        ImGuiTableFlags_ScrollY | ImGuiTableFlags_SizingFixedFit | ImGuiTableFlags_NoKeepColumnsVisible,
                        {0, (rows + 1) * row + 6})) {
    ImGui::TableSetupScrollFreeze(0, 1);
    for (std::size_t i = 0; i < columns; ++i) ImGui::TableSetupColumn(kColumns[i].label, 0, widths[i]);
    header(state, columns);
    if (std::exchange(state.inspect.seek, false)) {
      const auto at = std::ranges::find(order, state.inspect.picked) - order.begin();
      ImGui::SetScrollY(std::max(0.0f, (static_cast<float>(at) - kListRows / 2) * row));
    }
    ImGuiListClipper clipper;
    clipper.Begin(static_cast<int>(hits.size()));
    while (clipper.Step()) {
      for (int line = clipper.DisplayStart; line < clipper.DisplayEnd; ++line) {
        const int i = order[static_cast<std::size_t>(line)];
        const PixelHit& hit = hits[static_cast<std::size_t>(i)];
        ImGui::TableNextRow();
        ImGui::TableNextColumn();
        ImGui::PushID(i);
        if (ImGui::Selectable(std::to_string(hit.index).c_str(), i == state.inspect.picked,
                              ImGuiSelectableFlags_SpanAllColumns)) {
          pickHit(state, i);
        }
        ImGui::PopID();
        for (std::size_t c = 1; c < columns; ++c) {
          ImGui::TableNextColumn();
          cell(model, hit, kColumns[c].column);
        }
      }
    }
    ImGui::EndTable();
  }
  ImGui::PopStyleVar(2);
}

// Both halves of a texture side by side, with a ring where the hit fell.
void texture(const GaussianModel& model, std::size_t index, const GaussianFacts& facts, glm::dvec2 uv) {
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  const float side = std::min((ImGui::GetContentRegionAvail().x - spacing) / 2, ImGui::GetFontSize() * 9);
  const float cell = side / static_cast<float>(std::max(facts.width, facts.height));
  const int step = (std::max(facts.width, facts.height) + kMaxShownSide - 1) / kMaxShownSide;
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImGui::Dummy({2 * side + spacing, cell * static_cast<float>(facts.height)});
  hint("RGB (grey = adds nothing) and alpha, u to the right, v down, over +-3 sigma; the ring is the hit");
  ImDrawList* draw = ImGui::GetWindowDrawList();
  for (int half = 0; half < 2; ++half) {
    const float left = corner.x + static_cast<float>(half) * (side + spacing);
    for (int j = 0; j < facts.height; j += step) {
      for (int i = 0; i < facts.width; i += step) {
        const TexelColors colors = texelColors(model, index, i, j);
        const ImVec2 low(left + cell * static_cast<float>(i), corner.y + cell * static_cast<float>(j));
        const ImVec2 high(left + cell * static_cast<float>(std::min(i + step, facts.width)),
                          corner.y + cell * static_cast<float>(std::min(j + step, facts.height)));
        draw->AddRectFilled(low, high, packed(half == 0 ? colors.rgb : colors.alpha));
      }
    }
    if (std::max(std::abs(uv.x), std::abs(uv.y)) > 3) continue;
    const glm::vec2 at = glm::vec2(texelPosition(uv, facts.width, facts.height)) * cell;
    draw->AddCircle({left + at.x, corner.y + at.y}, 5, IM_COL32(0, 0, 0, 255), 0, 3);
    draw->AddCircle({left + at.x, corner.y + at.y}, 5, IM_COL32(255, 255, 255, 255), 0, 1.5f);
  }
}

void picked(ViewerState& state, const PixelHit& hit) {
  const GaussianModel& model = *state.scene.model;
  const GaussianFacts facts = factsOf(model, hit.index);
  heading(("GAUSSIAN " + grouped(hit.index)).c_str());
  ImGui::Text("mean %.5g, %.5g, %.5g", facts.mean.x, facts.mean.y, facts.mean.z);
  if (const std::optional<glm::dvec3> at = inspectedPoint(state)) {
    ImGui::Text("hit %.5g, %.5g, %.5g", at->x, at->y, at->z);
    hint("In the world, on the pixel's ray at the depth of the list");
  }
  ImGui::Text("sigma %.4g, %.4g, %.4g", facts.sigma.x, facts.sigma.y, facts.sigma.z);
  ImGui::Text("opacity %.3f, effective rank %.2f", facts.opacity, facts.effective_rank);
  hint("Rank: 1 a needle, 2 a disc, 3 a ball");
  ImGui::Text("u %.2f, v %.2f sigma", hit.uv.x, hit.uv.y);
  hint("Where the hit falls on the texture");
  ImGui::Text("value %.3f, T %.3f", hit.value, hit.transmittance);
  hint("The Gaussian there; the light that is left in front of it");
  if (facts.width > 0) {
    ImGui::Text("texture %d x %d, alpha x %.3f", facts.width, facts.height, hit.texture_alpha);
    texture(model, hit.index, facts, hit.uv);
  } else {
    ImGui::TextDisabled("no texture");
  }
}

void steps(ViewerState& state) {
  if (segment("Previous", false, 0, 3)) stepHit(state, -1);
  hint("In front of this one ([)");
  if (segment("Next", false, 1, 3)) stepHit(state, 1);
  hint("Behind this one (])");
  if (segment("Alone", state.inspect.isolated, 2, 3)) state.inspect.isolated = !state.inspect.isolated;
  hint("Draws this Gaussian only (N)");
}

}  // namespace

void inspectSection(ViewerState& state) {
  InspectState& inspection = state.inspect;
  heading("PIXEL");
  if (segment("Click picks", inspection.active, 0, 2)) inspection.active = !inspection.active;
  hint("A click on the picture inspects that pixel (M); Alt+click does so at any time");
  ImGui::BeginDisabled(!inspection.inspected);
  if (segment("Clear", false, 1, 2)) clearInspection(state);
  ImGui::EndDisabled();
  if (!inspection.inspected || !state.scene.model) {
    ImGui::TextDisabled(inspection.busy ? "looking ..." : "M and a click, or Alt+click, on a pixel");
    return;
  }
  ImGui::Text("%d, %d: %zu splats, %.1f %% of light left", inspection.pixel.x, inspection.pixel.y,
              inspection.hits.size(), 100 * lightLeft(inspection.hits));
  const glm::dvec3 color = colorOf(inspection.hits, effectiveSettings(state).background);
  swatch(glm::vec3(color));
  ImGui::SameLine();
  ImGui::Text("colour %.4f, %.4f, %.4f", color.x, color.y, color.z);
  hint("What the splats add up to with the background, in double precision, not clamped");
  if (inspection.hits.empty()) return;
  chart(state);
  list(state);
  if (inspection.picked < 0) return;
  steps(state);
  picked(state, inspection.hits[static_cast<std::size_t>(inspection.picked)]);
}

}  // namespace tg
