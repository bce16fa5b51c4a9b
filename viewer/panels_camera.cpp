// SPDX-License-Identifier: Apache-2.0
// Cameras of the model, lens and speed.
#include <imgui.h>

#include "viewer/actions.h"
#include "viewer/panel_sections.h"
#include "viewer/panel_widgets.h"

namespace tg {
namespace {

constexpr double kDegrees = 3.14159265358979323846 / 180.0;

bool escapePressed() { return ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape)); }

std::string cameraLabel(const Camera& camera, int index) {
  std::string label = std::to_string(index);
  if (!camera.name.empty()) label += "  " + camera.name;
  if (camera.test) label += "  (test)";
  return label;
}

void cameraList(ViewerState& state) {
  const std::vector<Camera>& cameras = state.scene.cameras;
  const std::string preview =
      state.camera.index >= 0 ? cameraLabel(cameras[state.camera.index], state.camera.index) : "free";
  const float button = ImGui::GetFrameHeight();
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x - 2 * (button + spacing));
  if (ImGui::BeginCombo("##camera", preview.c_str(), ImGuiComboFlags_HeightLarge)) {
    if (escapePressed()) ImGui::CloseCurrentPopup();
    ImGuiListClipper clipper;
    clipper.Begin(static_cast<int>(cameras.size()));
    while (clipper.Step()) {
      for (int i = clipper.DisplayStart; i < clipper.DisplayEnd; ++i) {
        ImGui::PushID(i);
        if (ImGui::Selectable(cameraLabel(cameras[i], i).c_str(), i == state.camera.index)) goToCamera(state, i);
        ImGui::PopID();
      }
    }
    ImGui::EndCombo();
  }
  ImGui::SameLine(0, spacing);
  if (ImGui::ArrowButton("##previous", ImGuiDir_Left)) apply(state, Action::previousCamera);
  hint("Previous camera (Shift+Space)");
  ImGui::SameLine(0, spacing);
  if (ImGui::ArrowButton("##next", ImGuiDir_Right)) apply(state, Action::nextCamera);
  hint("Next camera (Space)");
}

}  // namespace

void cameraSection(ViewerState& state) {
  heading("CAMERA");
  if (state.scene.cameras.empty())
    ImGui::TextDisabled("The model has no cameras");
  else
    cameraList(state);
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  const float half = (ImGui::GetContentRegionAvail().x - spacing) / 2;
  ImGui::SetNextItemWidth(half);
  auto degrees = static_cast<float>(state.camera.lens.fov_y / kDegrees);
  if (ImGui::SliderFloat("##lens", &degrees, 5.0f, 140.0f, "Lens %.1f\xc2\xb0", ImGuiSliderFlags_AlwaysClamp)) {
    state.camera.lens.fov_y = degrees * kDegrees;
    state.camera.index = -1;
  }
  hint("Vertical field of view (Ctrl+wheel)");
  ImGui::SameLine(0, spacing);
  ImGui::SetNextItemWidth(half);
  auto speed = static_cast<float>(state.camera.speed);
  if (ImGui::SliderFloat("##speed", &speed, 0.02f, 20.0f, "Speed %.2f",
                         ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp)) {
    state.camera.speed = speed;
  }
  hint("Of flying, in scene radii per second; Shift 4 x, Ctrl 1/4");
  if (segment("Frame", false, 0, 3)) apply(state, Action::frameScene);
  hint("The whole model in view (F)");
  if (segment("Reset", false, 1, 3)) apply(state, Action::resetView);
  hint("The first view (Shift+F)");
  if (segment("Save", false, 2, 3)) apply(state, Action::saveCamera);
  hint("This camera as JSON, for --camera (C)");
}

}  // namespace tg
