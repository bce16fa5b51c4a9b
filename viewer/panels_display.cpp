// SPDX-License-Identifier: Apache-2.0
// What of the model is shown: outputs, textures, intersection, background.
#include <imgui.h>

#include <array>
#include <utility>

#include "viewer/panel_sections.h"
#include "viewer/panel_widgets.h"

namespace tg {

void outputSection(ViewerState& state) {
  struct Choice {
    const char* label;
    const char* hint;
  };
  constexpr std::array<Choice, 7> choices = {{
      {"Final", "Base + texture + background"},
      {"Base", "Spherical harmonics alone, with the background"},
      {"Texture", "What the textures add to the colour; mid grey = nothing"},
      {"Alpha", "Coverage; black = the background shows"},
      {"Depth", "Near is bright, scaled to this picture; black = nothing hit"},
      {"Normal", "Shortest axis: red = right, green = up, blue = towards you"},
      {"Splats", "Blended splats per pixel; white = the most in this picture"},
  }};
  heading("SHOW");
  for (int i = 0; i < static_cast<int>(choices.size()); ++i) {
    const int row_start = i < 3 ? 0 : 3, row_count = i < 3 ? 3 : 4;
    if (segment(choices[i].label, static_cast<int>(state.display.output) == i, i - row_start, row_count)) {
      state.display.output = static_cast<Output>(i);
    }
    hint(choices[i].hint);
  }
}

void textureSection(ViewerState& state) {
  constexpr std::array<std::pair<const char*, TextureMode>, 4> choices = {{
      {"Off", TextureMode::none},
      {"Alpha", TextureMode::alpha},
      {"RGB", TextureMode::rgb},
      {"RGBA", TextureMode::rgba},
  }};
  heading("TEXTURES");
  ImGui::BeginDisabled(state.scene.textured == 0);
  const TextureMode shown = effectiveSettings(state).textures;
  for (int i = 0; i < static_cast<int>(choices.size()); ++i) {
    if (segment(choices[i].first, shown == choices[i].second, i, static_cast<int>(choices.size()))) {
      state.display.settings.textures = choices[i].second;
    }
    hint("T steps through these; hold Tab to compare with none");
  }
  ImGui::EndDisabled();
}

void intersectionSection(ViewerState& state) {
  heading("INTERSECTION");
  const IntersectionModel current = state.display.settings.intersection.value_or(state.scene.intersection);
  const auto choose = [&](const char* label, IntersectionModel model, int index) {
    if (segment(label, current == model, index, 2)) state.display.settings.intersection = model;
    hint(model == state.scene.intersection ? "What the model was trained with" : "Not what the model was trained with");
  };
  choose("Plane", IntersectionModel::plane, 0);
  choose("Max response", IntersectionModel::maxResponse, 1);
}

void backgroundSection(ViewerState& state) {
  heading("BACKGROUND");
  glm::vec3& color = state.display.settings.background;
  ImGui::ColorEdit3("##background", &color.x, ImGuiColorEditFlags_NoInputs);
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  ImGui::SameLine(0, spacing);
  if (segment("Black", color == glm::vec3(0.0f), 0, 3)) color = glm::vec3(0.0f);
  if (segment("White", color == glm::vec3(1.0f), 1, 3)) color = glm::vec3(1.0f);
  if (segment("Model's", color == state.scene.background, 2, 3)) color = state.scene.background;
  hint("What the model was trained against");
}

}  // namespace tg
