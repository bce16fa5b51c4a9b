// SPDX-License-Identifier: Apache-2.0
// Draws the scene's lines over the picture, under the panels.
#include <imgui.h>

#include <algorithm>

#include "viewer/panels/sections.h"
#include "viewer/view/scene_lines.h"

namespace tg {

PictureOnScreen pictureOnScreen(const ViewerState& state) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float left = panelWidth(state, size.x);
  // In ImGui's units: the picture's pixels may be finer. Of two pictures beside each other, the left one.
  int width = std::max(static_cast<int>(size.x - left), 1);
  if (state.compare.how.mode == CompareMode::side) width = sideWidth(width);
  return {toCamera(state.camera.pose, state.camera.lens, width, std::max(static_cast<int>(size.y), 1)),
          {left, 0},
          static_cast<float>(state.ui.scale)};
}

void pushClipRect(const PictureOnScreen& picture) {
  const ImVec2 corner(picture.corner.x, picture.corner.y);
  const glm::vec2 size(picture.camera.size);
  ImGui::GetBackgroundDrawList()->PushClipRect(corner, {corner.x + size.x, corner.y + size.y});
}

void sceneOverlay(const ViewerState& state) {
  if (state.record.draws()) return;
  const PictureOnScreen picture = pictureOnScreen(state);
  const Camera& camera = picture.camera;
  ImDrawList* draw = ImGui::GetBackgroundDrawList();
  pushClipRect(picture);
  for (const SceneLine& line : sceneLines(state)) {
    const auto ends = projected(camera, line.a, line.b);
    if (!ends) continue;
    const auto pixel = [&](glm::dvec2 p) {
      return ImVec2(picture.corner.x + static_cast<float>(std::clamp(p.x, -1e5, 1e5)),
                    picture.corner.y + static_cast<float>(std::clamp(p.y, -1e5, 1e5)));
    };
    draw->AddLine(pixel(ends->first), pixel(ends->second),
                  ImGui::ColorConvertFloat4ToU32({line.color.x, line.color.y, line.color.z, 0.9f}), line.width);
  }
  editOverlay(state, picture);
  draw->PopClipRect();
  toolOverlay(state);
}

}  // namespace tg
