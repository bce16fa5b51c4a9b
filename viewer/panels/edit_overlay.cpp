// SPDX-License-Identifier: Apache-2.0
// What edit tools show over the picture, and the pointer that they get.
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "viewer/panels/panels.h"
#include "viewer/panels/sections.h"
#include "viewer/view/edit_pointer.h"
#include "viewer/view/edits.h"
#include "viewer/view/inspection.h"
#include "viewer/view/scene_lines.h"

namespace tg {
namespace {

constexpr ImU32 kChosen = IM_COL32(255, 170, 30, 230);
constexpr ImU32 kChosenRim = IM_COL32(40, 20, 0, 160);
constexpr ImU32 kToolLine = IM_COL32(255, 255, 255, 230);
constexpr ImU32 kToolShade = IM_COL32(0, 0, 0, 120);
constexpr int kCircleSteps = 64;
constexpr std::size_t kRimmedDots = 3000;  // more of them would hide the picture

// A place of the picture on screen; far beside it where it is none.
ImVec2 onScreen(const PictureOnScreen& picture, glm::dvec2 at) {
  const auto bounded = [](double x) { return static_cast<float>(std::isfinite(x) ? std::clamp(x, -1e5, 1e5) : -1e5); };
  return {picture.corner.x + bounded(at.x), picture.corner.y + bounded(at.y)};
}

// A light line with a dark one beneath, seen over any picture.
void toolLine(const PictureOnScreen& picture, ImDrawList* draw, const ImVec2* points, int count, bool closed) {
  const ImDrawFlags flags = closed ? ImDrawFlags_Closed : ImDrawFlags_None;
  draw->AddPolyline(points, count, kToolShade, flags, 3.0f * picture.scale);
  draw->AddPolyline(points, count, kToolLine, flags, 1.2f * picture.scale);
}

// Where the drag under way has moved them.
void dots(const ViewerState& state, const PictureOnScreen& picture, ImDrawList* draw) {
  const SelectionPtr& selection = state.edit.selection;
  if (!selection || !state.scene.model || selection->chosen.size() != state.scene.model->size()) return;
  const Similarity s = state.edit.moving ? state.edit.moving->similarity : Similarity{};
  const RenderSettings settings = effectiveSettings(state);
  const bool rims = selection->dots.size() < kRimmedDots;
  for (const std::uint32_t i : selection->dots) {
    const glm::dvec3 mean(state.scene.model->mean[i]);
    const glm::dvec3 p = cameraFromWorld(picture.camera, s.scale * (s.rotation * mean) + s.translation);
    if (p.z <= double{settings.near}) continue;
    const glm::dvec2 at = project(picture.camera, p);
    const glm::dvec2 size(picture.camera.size);
    if (!(at.x >= 0 && at.y >= 0 && at.x < size.x && at.y < size.y)) continue;
    const ImVec2 c = onScreen(picture, at);
    const float r = picture.scale;
    if (rims) draw->AddRectFilled({c.x - 2 * r, c.y - 2 * r}, {c.x + 2 * r, c.y + 2 * r}, kChosenRim);
    draw->AddRectFilled({c.x - r, c.y - r}, {c.x + r, c.y + r}, kChosen);
  }
}

void circle(const PictureOnScreen& picture, ImDrawList* draw, glm::dvec2 middle, double radius) {
  std::vector<ImVec2> points;
  for (int i = 0; i < kCircleSteps; ++i) {
    const double angle = 2 * 3.14159265358979323846 * i / kCircleSteps;
    points.push_back(onScreen(picture, middle + radius * glm::dvec2(std::cos(angle), std::sin(angle))));
  }
  toolLine(picture, draw, points.data(), kCircleSteps, true);
}

// Three great circles.
void sphere(const ViewerState& state, const PictureOnScreen& picture, ImDrawList* draw) {
  if (!state.edit.surface) return;
  const double radius = state.edit.sphere * state.scene.bounds.radius;
  for (int axis = 0; axis < 3; ++axis) {
    for (int i = 0; i < kCircleSteps; ++i) {
      const auto point = [&](int step) {
        const double angle = 2 * 3.14159265358979323846 * step / kCircleSteps;
        glm::dvec3 p(0.0);
        p[(axis + 1) % 3] = radius * std::cos(angle);
        p[(axis + 2) % 3] = radius * std::sin(angle);
        return *state.edit.surface + p;
      };
      const auto ends = projected(picture.camera, point(i), point(i + 1));
      if (!ends) continue;
      const ImVec2 points[] = {onScreen(picture, ends->first), onScreen(picture, ends->second)};
      toolLine(picture, draw, points, 2, false);
    }
  }
}

void gizmo(const ViewerState& state, const PictureOnScreen& picture, ImDrawList* draw) {
  const std::optional<Gizmo> shown = shownGizmo(state, picture.camera);
  if (!shown) return;
  const auto& moving = state.edit.moving;
  const Handle lit = moving ? moving->handle : state.edit.hovered;
  const float one = picture.scale;
  for (const GizmoLine& line : gizmoLines(*shown, picture.camera)) {
    if (line.points.size() < 2) continue;
    ImU32 color = IM_COL32(235, 235, 235, 255);
    if (line.handle == Handle::x) color = IM_COL32(240, 80, 80, 255);
    if (line.handle == Handle::y) color = IM_COL32(90, 215, 90, 255);
    if (line.handle == Handle::z) color = IM_COL32(95, 150, 255, 255);
    if (line.handle == lit) color = IM_COL32(255, 225, 70, 255);
    std::vector<ImVec2> points;
    for (const glm::dvec2 p : line.points) points.push_back(onScreen(picture, p));
    const int count = static_cast<int>(points.size());
    draw->AddPolyline(points.data(), count, kToolShade, 0, 5.0f * one);
    draw->AddPolyline(points.data(), count, color, 0, (line.handle == lit ? 3.5f : 2.5f) * one);
    if (!line.arrow) continue;
    const ImVec2 tip = points.back(), foot = points.front();
    const float dx = tip.x - foot.x, dy = tip.y - foot.y, length = std::sqrt(dx * dx + dy * dy);
    if (length < 12 * one) continue;
    const ImVec2 u(one * dx / length, one * dy / length);
    draw->AddTriangleFilled({tip.x + 10 * u.x, tip.y + 10 * u.y}, {tip.x - 5 * u.y, tip.y + 5 * u.x},
                            {tip.x + 5 * u.y, tip.y - 5 * u.x}, color);
  }
  if (!moving || !state.edit.pointer) return;
  const std::string text = dragText(moving->gizmo, moving->handle, moving->similarity);
  const ImVec2 at = onScreen(picture, *state.edit.pointer), size = ImGui::CalcTextSize(text.c_str());
  draw->AddRectFilled({at.x + 14 * one, at.y + 12 * one}, {at.x + 22 * one + size.x, at.y + 18 * one + size.y},
                      IM_COL32(27, 30, 35, 220), 4 * one);
  draw->AddText({at.x + 18 * one, at.y + 15 * one}, kToolLine, text.c_str());
}

// The inspected pixel, wherever the camera has gone since.
void pixelMark(const ViewerState& state, const PictureOnScreen& picture, ImDrawList* draw) {
  const auto point = inspectedPoint(state);
  if (!point) return;
  const glm::dvec3 p = cameraFromWorld(picture.camera, *point);
  if (!(p.z > 0)) return;
  const ImVec2 c = onScreen(picture, project(picture.camera, p));
  for (const auto& [x, y] : {std::pair(1.0f, 0.0f), {-1.0f, 0.0f}, {0.0f, 1.0f}, {0.0f, -1.0f}}) {
    const float near = 4 * picture.scale, far = 12 * picture.scale;
    const ImVec2 ends[] = {{c.x + near * x, c.y + near * y}, {c.x + far * x, c.y + far * y}};
    toolLine(picture, draw, ends, 2, false);
  }
  const ImVec2 low(c.x - 2 * picture.scale, c.y - 2 * picture.scale);
  const ImVec2 high(c.x + 2 * picture.scale, c.y + 2 * picture.scale);
  draw->AddRect(low, high, kToolShade, 0, 0, 3.0f * picture.scale);
  draw->AddRect(low, high, kToolLine, 0, 0, picture.scale);
}

// Of two pictures beside each other the one that the tool is at work in: their cameras are alike.
PictureOnScreen toolPicture(const ViewerState& state) {
  PictureOnScreen picture = pictureOnScreen(state);
  const bool in_right = state.compare.how.mode == CompareMode::side && state.edit.in_right;
  if (in_right) picture.corner.x += static_cast<float>(picture.camera.size.x);
  return picture;
}

}  // namespace

void editOverlay(const ViewerState& state, const PictureOnScreen& picture) {
  ImDrawList* draw = ImGui::GetBackgroundDrawList();
  pixelMark(state, picture, draw);
  dots(state, picture, draw);
}

void toolOverlay(const ViewerState& state) {
  const EditState& edit = state.edit;
  if (edit.tool == EditTool::none) return;
  const PictureOnScreen picture = toolPicture(state);
  ImDrawList* draw = ImGui::GetBackgroundDrawList();
  pushClipRect(picture);
  if (edit.tool == EditTool::rectangle && edit.selecting) {
    const ImVec2 a = onScreen(picture, edit.selecting->from), b = onScreen(picture, edit.selecting->to);
    const ImVec2 corners[] = {a, {b.x, a.y}, b, {a.x, b.y}};
    draw->AddRectFilled({std::min(a.x, b.x), std::min(a.y, b.y)}, {std::max(a.x, b.x), std::max(a.y, b.y)},
                        IM_COL32(255, 255, 255, 25));
    toolLine(picture, draw, corners, 4, true);
  }
  if (edit.tool == EditTool::brush && edit.pointer) circle(picture, draw, *edit.pointer, edit.brush);
  if (edit.tool == EditTool::sphere && edit.pointer) sphere(state, picture, draw);
  gizmo(state, picture, draw);
  draw->PopClipRect();
}

PointerTaken editInput(ViewerState& state) {
  const ImGuiIO& io = ImGui::GetIO();
  if (!state.edit.selecting && !state.edit.moving) {
    const PictureOnScreen left = pictureOnScreen(state);
    state.edit.in_right = io.MousePos.x >= left.corner.x + static_cast<float>(left.camera.size.x);
  }
  const PictureOnScreen picture = toolPicture(state);
  EditPointer pointer;
  pointer.at = {static_cast<double>(io.MousePos.x - picture.corner.x),
                static_cast<double>(io.MousePos.y - picture.corner.y)};
  const glm::dvec2 size(picture.camera.size);
  pointer.over = !io.WantCaptureMouse && !io.KeyAlt && pointer.at.x >= 0 && pointer.at.y >= 0 &&
                 pointer.at.x < size.x && pointer.at.y < size.y;
  pointer.pressed = ImGui::IsMouseClicked(0);
  pointer.down = io.MouseDown[0];
  pointer.wheel = static_cast<double>(io.MouseWheel);
  pointer.shift = io.KeyShift;
  pointer.control = io.KeyCtrl;
  return editPointer(state, pointer, picture.camera);
}

}  // namespace tg
