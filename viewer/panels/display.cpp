// SPDX-License-Identifier: Apache-2.0
// What of the model is shown: outputs, textures, intersection, background.
#include <imgui.h>

#include <array>
#include <utility>

#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"

namespace tg {

void outputSection(ViewerState& state) {
  struct Choice {
    const char* label;
    Output output;
    const char* hint;
  };
  constexpr std::array<Choice, kOutputKinds> choices = {{
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
  }};
  constexpr int kColumns = 4;
  heading("SHOW");
  for (int i = 0; i < static_cast<int>(choices.size()); ++i) {
    const Choice& choice = choices[static_cast<std::size_t>(i)];
    if (segment(choice.label, state.display.output == choice.output, i % kColumns, kColumns))
      state.display.output = choice.output;
    hint(choice.hint);
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
  TextureFilter& filter = state.display.settings.texture_filter;
  if (segment("Bilinear", filter == TextureFilter::bilinear, 0, 2)) filter = TextureFilter::bilinear;
  hint("Texels as they are (Y)");
  if (segment("Footprint", filter == TextureFilter::footprint, 1, 2)) filter = TextureFilter::footprint;
  hint("Texels smaller than a pixel fade to the texture's mean: no shimmer far away (Y)");
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
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
  ImGui::SliderFloat("##exposure", &state.display.exposure, -kMaxExposure, kMaxExposure, "Exposure %+.2f stops",
                     ImGuiSliderFlags_AlwaysClamp);
  hint("Of final and base, before they are clamped; double click to type");
}

void blendSection(ViewerState& state) {
  RenderSettings& settings = state.display.settings;
  heading("ORDER AND ANTIALIASING");
  if (segment("Global", settings.order == SplatOrder::global, 0, 4)) settings.order = SplatOrder::global;
  hint("One order for all pixels: fast, may pop as the camera turns (O)");
  if (segment("Per pixel", settings.order == SplatOrder::perPixel, 1, 4)) settings.order = SplatOrder::perPixel;
  hint("Every pixel's own order: no popping, slower (O)");
  if (segment("AA off", settings.antialiasing == Antialiasing::off, 2, 4)) settings.antialiasing = Antialiasing::off;
  hint("Gaussians as they are (Shift+Y)");
  if (segment("Screen", settings.antialiasing == Antialiasing::screen, 3, 4))
    settings.antialiasing = Antialiasing::screen;
  hint("No Gaussian narrower than a pixel, its opacity makes up for it (Shift+Y)");
}

void scaleSection(ViewerState& state) {
  RenderSettings& settings = state.display.settings;
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  const float half = (ImGui::GetContentRegionAvail().x - spacing) / 2;
  heading("SCALES");
  ImGui::SetNextItemWidth(half);
  ImGui::SliderFloat("##opacity", &settings.opacity_scale, 0.0f, kMaxScale, "Opacity x %.2f",
                     ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp);
  hint("On every opacity; double click to type");
  ImGui::SameLine(0, spacing);
  ImGui::SetNextItemWidth(half);
  ImGui::SliderFloat("##splats", &settings.splat_scale, kMinSplatScale, kMaxScale, "Size x %.2f",
                     ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp);
  hint("On every sigma");
  ImGui::SetNextItemWidth(half);
  ImGui::SliderInt("##degree", &settings.max_sh_degree, 0, 3, "SH degree %d", ImGuiSliderFlags_AlwaysClamp);
  hint("Higher bands of the model are left out");
  ImGui::SameLine(0, spacing);
  if (segment("As trained", false, 0, 1)) {
    const RenderSettings usual;
    settings.opacity_scale = usual.opacity_scale;
    settings.splat_scale = usual.splat_scale;
    settings.max_sh_degree = usual.max_sh_degree;
  }
}

void cropSection(ViewerState& state) {
  DisplayState& display = state.display;
  heading("CROP BOX");
  if (segment(display.crop ? "On" : "Off", display.crop, 0, 3)) display.crop = !display.crop;
  hint("Only Gaussians whose mean lies inside are drawn (J)");
  if (segment("Fit", false, 1, 3)) fitCrop(state);
  hint("Around the middle 98 % of the means, along every axis");
  if (segment("Reset", false, 2, 3)) resetCrop(state);
  hint("Around all means");
  if (!display.crop) return;
  const float speed = 0.005f * static_cast<float>(state.scene.bounds.radius);
  const auto corner = [&](const char* id, glm::vec3& value) {
    ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
    return ImGui::DragFloat3(id, &value.x, speed, 0, 0, "%.3f");
  };
  if (corner("##low", display.box.min)) display.box.max = glm::max(display.box.min, display.box.max);
  if (corner("##high", display.box.max)) display.box.min = glm::min(display.box.min, display.box.max);
}

}  // namespace tg
