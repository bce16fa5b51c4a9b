// SPDX-License-Identifier: Apache-2.0
// What of the model is shown: outputs, textures, intersection, background.
#include <imgui.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"
#include "viewer/view/actions.h"
#include "viewer/view/legend.h"

namespace tg {

constexpr std::size_t kMostButtons = 4;           // in a line
constexpr std::size_t kLeastOfSlider = 1'000;     // Gaussians
constexpr const char* kColoursTitle = "COLOURS";  // holds what the output at hand has

void outputSection(ViewerState& state) {
  struct Choice {
    const char* label;
    Output output;
    const char* hint;
  };
  constexpr std::array choices = std::to_array<Choice>({
      {"Final", Output::final, "Base + texture + background (1)"},
      {"Base", Output::base, "Spherical harmonics alone, with the background (2)"},
      {"Texture", Output::texture, "What the textures add to the colour; mid grey = nothing (3)"},
      {"Alpha", Output::alpha, "Coverage; black = the background shows (4)"},
      {"Depth", Output::depth, "Expected depth: near is bright, scaled to this picture; black = nothing hit (5)"},
      {"Median", Output::depthMedian, "Depth at which half of the light is stopped (8)"},
      {"Normal", Output::normal, "Shortest axis: red = right, green = up, blue = towards you (6)"},
      {"Texels", Output::texelDensity, "Texels a pixel: black 1/64, white 4 and more (=)"},
      {"Splats", Output::count, "Blended splats per pixel; white = the most in this picture (7)"},
      {"Overdraw", Output::overdraw, "Splats per pixel, those behind what is opaque included (9)"},
      {"Ellipsoid", Output::ellipsoids, "Gaussians as solid surfaces at one sigma (0)"},
      {"Centres", Output::centers, "A dot at every mean (-)"},
  });
  static_assert(choices.size() == kCount<Output>, "a button for each output");
  constexpr int kColumns = kMostButtons;
  heading("SHOW");
  for (int i = 0; i < static_cast<int>(choices.size()); ++i) {
    const Choice& choice = choices[static_cast<std::size_t>(i)];
    if (segment(choice.label, state.display.output == choice.output, i % kColumns, kColumns)) {
      state.display.output = choice.output;
    }
    hint(choice.hint);
  }
  if (hasLegend(state.display.output)) settingSection(state, kColoursTitle);
}

std::size_t settingWidgets(ViewerState& state, std::string_view heading) {
  using Button = std::pair<const RenderSetting*, const RenderSetting::Choice*>;
  std::vector<std::vector<Button>> lines;
  std::vector<const RenderSetting*> sliders;
  for (const RenderSetting& setting : renderSettings()) {
    if (setting.section != heading) continue;
    if (heading == kColoursTitle && !setting.outputs.has(state.display.output)) continue;
    if (setting.number || setting.whole) sliders.push_back(&setting);
    if (setting.choices.empty()) continue;
    if (lines.empty() || lines.back().size() + setting.choices.size() > kMostButtons) lines.emplace_back();
    for (const RenderSetting::Choice& choice : setting.choices) lines.back().emplace_back(&setting, &choice);
  }
  RenderSettings& settings = state.display.settings;
  const RenderSettings shown = shownSettings(state, effectiveSettings(state));
  for (const std::vector<Button>& line : lines) {
    for (std::size_t i = 0; i < line.size(); ++i) {
      const auto& [setting, choice] = line[i];
      const bool active = setting->get(shown) == choice->name;
      ImGui::PushID(setting);
      if (segment(choice->label, active, static_cast<int>(i), static_cast<int>(line.size()))) {
        setting->set(settings, std::string(choice->name), "");
      }
      ImGui::PopID();
      const char* trained = choice->name == name(state.scene.intersection) ? "What the model was trained with"
                                                                           : "Not what the model was trained with";
      hint(((choice->help ? choice->help : trained) + keyOf(setting->name)).c_str());
    }
  }
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x, room = ImGui::GetContentRegionAvail().x;
  for (std::size_t i = 0; i < sliders.size(); ++i) {
    const RenderSetting::Slider& range = sliders[i]->slider;
    const std::string id = "##" + std::string(sliders[i]->name);
    const ImGuiSliderFlags flags = range.logarithmic ? ImGuiSliderFlags_Logarithmic : ImGuiSliderFlags_None;
    if (i % 2 == 1) ImGui::SameLine(0, spacing);
    ImGui::SetNextItemWidth(sliders.size() > 1 ? (room - spacing) / 2 : room);
    if (sliders[i]->number) {
      slider(id.c_str(), settings.*sliders[i]->number, range.low, range.high, range.format, flags);
    } else {
      const int low = static_cast<int>(range.low), high = static_cast<int>(range.high);
      slider(id.c_str(), ImGuiDataType_S32, &(settings.*sliders[i]->whole), &low, &high, range.format, flags);
    }
    hint(range.help);
  }
  return sliders.size();
}

void settingSection(ViewerState& state, const char* title) {
  heading(title);
  settingWidgets(state, title);
}

void textureSection(ViewerState& state) {
  const bool beside = state.compare.how.mode != CompareMode::off && !state.compare.with_photographs;
  const int other = beside ? otherDocument(state) : -1;
  const bool textured = state.scene.textured > 0 || (other >= 0 && sceneAt(state, other).textured > 0);
  ImGui::BeginDisabled(!textured);
  settingSection(state, "TEXTURES");
  ImGui::EndDisabled();
}

void backgroundSection(ViewerState& state) {
  heading("BACKGROUND");
  glm::vec3& color = state.display.settings.background;
  ImGui::ColorEdit3("##background", &color.x, ImGuiColorEditFlags_NoInputs);
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  ImGui::SameLine(0, spacing);
  const bool own = color == state.scene.background;  // which may be black, and is lit alone then
  if (segment("Black", !own && color == glm::vec3(0.0f), 0, 3)) color = glm::vec3(0.0f);
  if (segment("White", !own && color == glm::vec3(1.0f), 1, 3)) color = glm::vec3(1.0f);
  if (segment("Model's", own, 2, 3)) color = state.scene.background;
  hint("What the model was trained against");
  settingWidgets(state, "BACKGROUND");
}

void scaleSection(ViewerState& state) {
  constexpr const char* kTitle = "SCALES";
  heading(kTitle);
  if (settingWidgets(state, kTitle) % 2 == 1) ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
  if (!segment("As trained", false, 0, 1)) return;
  for (const RenderSetting& setting : renderSettings()) {
    if (setting.section == kTitle) setting.set(state.display.settings, setting.get({}), "");
  }
}

void cropSection(ViewerState& state) {
  DisplayState& display = state.display;
  heading("CROP BOX");
  if (segment(display.crop ? "On##crop" : "Off##crop", display.crop, 0, 3)) display.crop = !display.crop;
  hint("Only Gaussians whose mean lies inside are drawn (J)");
  if (segment("Fit", false, 1, 3)) fitCrop(state);
  hint("Around the middle 98 % of the means, along every axis");
  if (segment("Reset", false, 2, 3)) resetCrop(state);
  hint("Around all means");
  if (!display.crop) return;
  const float speed = 0.005f * static_cast<float>(state.scene.bounds.radius);
  CropBox& box = display.box;
  if (vectorField("##low", box.min, speed, "%.3f")) box.min = glm::min(box.min, box.max);
  if (vectorField("##high", box.max, speed, "%.3f")) box.max = glm::max(box.min, box.max);
}

void levelSection(ViewerState& state) {
  if (state.scene.streamed_from == 0) return;
  heading("LEVELS OF DETAIL");
  std::uint64_t budget = state.stream.budget;
  const std::uint64_t most = std::clamp(state.scene.streamed_from, kLeastOfSlider, kMostSplatBudget);
  const std::uint64_t least = kLeastOfSlider;
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
  if (slider("##budget", ImGuiDataType_U64, &budget, &least, &most, "At most %llu Gaussians",
             ImGuiSliderFlags_Logarithmic)) {
    state.stream.budget = static_cast<std::size_t>(budget);
  }
  hint("How many are drawn: those that the picture needs most");
}

}  // namespace tg
