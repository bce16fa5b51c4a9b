// SPDX-License-Identifier: Apache-2.0
// Cameras of the model, lens and speed.
#include <imgui.h>

#include "viewer/panels/sections.h"
#include "viewer/panels/widgets.h"
#include "viewer/view/actions.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/names.h"
#include "viewer/view/path_editor.h"

namespace tg {
namespace {

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
  hint("The model's cameras; free: the view is none of them");
  ImGui::SameLine(0, spacing);
  if (ImGui::ArrowButton("##previous", ImGuiDir_Left)) stepCamera(state, -1);
  hint("Previous camera (Shift+Space)");
  ImGui::SameLine(0, spacing);
  if (ImGui::ArrowButton("##next", ImGuiDir_Right)) stepCamera(state, 1);
  hint("Next camera (Space)");
}

// A click goes there; a double click opens a field on the name, until another widget or Enter takes it away.
void bookmarkRow(ViewerState& state, int index, float width) {
  std::string& name = state.camera.bookmarks[static_cast<std::size_t>(index)].name;
  enum Naming { off, begun, on };
  int& naming = *ImGui::GetStateStorage()->GetIntRef(ImGui::GetID("naming"));
  if (naming != off) {
    ImGui::SetNextItemWidth(width);
    if (naming == begun) ImGui::SetKeyboardFocusHere();
    textField("##name", name, "name");
    if (ImGui::IsItemActive()) {
      naming = on;
    } else if (naming == on) {  // left, or taken away while another page was shown
      naming = off;
    }
    return;
  }
  const char* label = name.empty() ? "(no name)" : name.c_str();
  const bool chosen = index == state.camera.bookmark;
  if (ImGui::Selectable(label, chosen, ImGuiSelectableFlags_AllowDoubleClick, {width, 0})) {
    naming = ImGui::IsMouseDoubleClicked(0) ? begun : off;
    if (naming == off) goToBookmark(state, static_cast<std::size_t>(index));
  }
  hint("Go there; a double click opens a field for its name");
}

}  // namespace

void cameraSection(ViewerState& state) {
  heading("CAMERA");
  if (state.scene.cameras.empty()) {
    ImGui::TextDisabled("The model has no cameras");
  } else {
    cameraList(state);
  }
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  const float half = (ImGui::GetContentRegionAvail().x - spacing) / 2;
  ImGui::SetNextItemWidth(half);
  auto degrees = static_cast<float>(state.camera.lens.fov_y / kDegrees);
  if (slider("##lens", degrees, 5.0f, 140.0f, "Lens %.1f\xc2\xb0")) {
    state.camera.lens.fov_y = degrees * kDegrees;
    leaveCamera(state.camera);
  }
  hint("Vertical field of view (Ctrl+wheel)");
  ImGui::SameLine(0, spacing);
  ImGui::SetNextItemWidth(half);
  auto speed = static_cast<float>(state.camera.speed);
  if (slider("##speed", speed, 0.02f, 20.0f, "Speed %.2f", ImGuiSliderFlags_Logarithmic)) {
    state.camera.speed = speed;
  }
  hint("Of flying, in scene radii per second; Shift 4 x, Alt 1/4");
  settingWidgets(state, "CAMERA");
  if (segment("Frame", false, 0, 3)) frameScene(state);
  hint("The whole model in view (F)");
  if (segment("Reset", false, 1, 3)) resetView(state);
  hint("The first view (Shift+F)");
  if (segment("Save", false, 2, 3)) saveCamera(state);
  hint("This camera as JSON, for --camera (C)");
}

void motionSection(ViewerState& state) {
  CameraState& camera = state.camera;
  heading("LEFT DRAG");
  if (segment("Orbits", !camera.fly, 0, 2)) camera.fly = false;
  hint("Around the point in the middle (G)");
  if (segment("Looks around", camera.fly, 1, 2)) camera.fly = true;
  hint("Around the camera, to fly with W A S D Q E (G)");
  heading("UP");
  const float spacing = ImGui::GetStyle().ItemInnerSpacing.x;
  if (segment("Cameras'", camera.up == UpAxis::cameras, 0, 1)) setUp(state, UpAxis::cameras);
  hint("The mean of the model's cameras, or -y where it has none (U: the next)");
  for (int i = 1; i < kCount<UpAxis>; ++i) {
    const auto axis = static_cast<UpAxis>(i);
    if (segment(std::string(name(axis)).c_str(), camera.up == axis, i - 1, kCount<UpAxis> - 1)) setUp(state, axis);
    hint("The world's axis that is up (U: the next)");
  }
  heading("TURNTABLE");
  if (segment(camera.turntable ? "Stop" : "Turn", camera.turntable, 0, 2)) toggleTurntable(state);
  hint("Round the point in the middle (R)");
  ImGui::SameLine(0, spacing);
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
  auto speed = static_cast<float>(camera.turntable_speed / kDegrees);
  if (slider("##turn", speed, -180.0f, 180.0f, "%.0f\xc2\xb0 / s")) {
    camera.turntable_speed = speed * kDegrees;
  }
  hint("Counter-clockwise, seen from above; less than 0: clockwise");
}

void bookmarkSection(ViewerState& state) {
  CameraState& camera = state.camera;
  std::string& file = camera.bookmark_file;
  heading("BOOKMARKS");
  if (segment("Add", false, 0, 3)) attempt(state, [&] { addBookmark(state); });
  hint("The view at hand (Shift+B); B goes through them");
  ImGui::BeginDisabled(camera.bookmarks.empty());
  if (segment("Save##bookmarks", false, 1, 3) && mayReplace(state, file = withJson(file), "bookmarks")) {
    attempt(state, [&] {
      saveBookmarks(state, file);
      noteBookmarksKept(state);
      notify(state, "Saved " + absolutePath(file).string());
    });
  }
  hint("As a cameras.json of this name");
  ImGui::EndDisabled();
  if (segment("Load", false, 2, 3)) attempt(state, [&] { loadBookmarks(state, file); });
  hint("From a cameras.json of this name");
  ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
  textField("##bookmarks", file, "file");
  fileHint(file);
  const float close = ImGui::GetFrameHeight();
  ImGui::PushID(state.scene.path.c_str());  // another model's are no rows of these
  for (int i = 0; i < static_cast<int>(camera.bookmarks.size()); ++i) {
    ImGui::PushID(i);
    const float width = ImGui::GetContentRegionAvail().x - close - ImGui::GetStyle().ItemInnerSpacing.x;
    ImGui::AlignTextToFramePadding();
    bookmarkRow(state, i, width);
    ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
    const bool remove = ImGui::SmallButton("x");
    ImGui::PopID();
    if (remove) {
      removeBookmark(state, static_cast<std::size_t>(i));
      break;
    }
  }
  ImGui::PopID();
}

}  // namespace tg
