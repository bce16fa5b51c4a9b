// SPDX-License-Identifier: Apache-2.0
// From presses and drags to selections and moves.
#include "viewer/view/edit_pointer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "converter/edit/select.h"
#include "viewer/view/edits.h"

namespace tg {
namespace {

constexpr double kWheelRadius = 1.1;                // of brush and sphere, a notch
constexpr std::size_t kHoverGaussians = 1'000'000;  // larger models show the sphere once it is set

bool selects(EditTool tool) {
  return tool == EditTool::rectangle || tool == EditTool::brush || tool == EditTool::sphere;
}

void findSurface(ViewerState& state, const Camera& camera, glm::dvec2 at) {
  state.edit.surface = surfaceAt(*state.scene.model, camera, effectiveSettings(state), glm::ivec2(glm::floor(at)));
}

void beginSelecting(ViewerState& state, const EditPointer& pointer, const Camera& camera) {
  EditState& edit = state.edit;
  SelectDrag drag;
  drag.mode = heldMode(edit, pointer.shift, pointer.control);
  drag.before = edit.selection;
  drag.from = drag.to = pointer.at;
  if (edit.tool == EditTool::sphere) {
    findSurface(state, camera, pointer.at);
    std::vector<std::uint8_t> found(state.scene.model->size());
    if (edit.surface) found = insideSphere(*state.scene.model, *edit.surface, edit.sphere * state.scene.bounds.radius);
    choose(state, std::move(found), drag.mode, drag.before);
  } else {
    drag.points = projectedMeans(*state.scene.model, camera, effectiveSettings(state));
    drag.swept.resize(drag.points.size());
  }
  edit.selecting = std::move(drag);
}

// Brush and rectangle; `last`: the button was let go.
void goOnSelecting(ViewerState& state, const EditPointer& pointer, const Camera& camera, bool last) {
  EditState& edit = state.edit;
  SelectDrag& drag = *edit.selecting;
  const glm::dvec2 before = std::exchange(drag.to, pointer.at);
  const bool still = before == drag.to && !pointer.pressed;
  if (drag.points.empty() || (still && !last)) return;
  std::vector<std::uint8_t> found;
  if (edit.tool == EditTool::brush) {
    sweep(drag.points, before, drag.to, edit.brush, drag.swept);
    found = drag.swept;
  } else if (last) {
    found = insideRectangle(drag.points, drag.from, drag.to);
  } else {
    return;
  }
  if (last && edit.visible_only) keepVisible(*state.scene.model, camera, effectiveSettings(state), found);
  choose(state, std::move(found), drag.mode, drag.before);
}

void endMoving(ViewerState& state) {
  const GizmoDrag drag = *std::exchange(state.edit.moving, std::nullopt);
  ModelPtr known;
  if (const auto& preview = state.edit.preview; preview && preview->of == state.scene.model) {
    const Similarity& s = preview->similarity;
    if (s.scale == drag.similarity.scale && s.rotation == drag.similarity.rotation &&
        s.translation == drag.similarity.translation) {
      known = preview->model;
    }
  }
  attempt(state, [&] { transformChosen(state, drag.similarity, known); });
  state.edit.preview.reset();
}

}  // namespace

bool hasButton(const EditState& edit) {
  return selects(edit.tool) || (edit.tool != EditTool::none && (edit.moving || edit.hovered != Handle::none));
}

std::optional<Gizmo> shownGizmo(const ViewerState& state, const Camera& camera) {
  if (!isWhole(state.scene)) return std::nullopt;
  GizmoKind kind = GizmoKind::move;
  switch (state.edit.tool) {
    case EditTool::move:
      break;
    case EditTool::turn:
      kind = GizmoKind::turn;
      break;
    case EditTool::scale:
      kind = GizmoKind::scale;
      break;
    default:
      return std::nullopt;
  }
  glm::dvec3 origin = editPivot(state);
  if (state.edit.moving) {
    const Similarity& s = state.edit.moving->similarity;
    origin = s.scale * (s.rotation * origin) + s.translation;
  }
  return gizmoAt(kind, origin, camera, state.ui.scale);
}

PointerTaken editPointer(ViewerState& state, const EditPointer& pointer, const Camera& camera) {
  EditState& edit = state.edit;
  if (!pointer.down) state.ui.drag_spent = false;
  PointerTaken taken{state.ui.drag_spent, false};
  if (edit.tool == EditTool::none || !isWhole(state.scene)) {
    edit.pointer.reset();
    return taken;
  }
  const bool moved = edit.pointer != pointer.at;
  edit.pointer = pointer.over || edit.selecting || edit.moving ? std::optional(pointer.at) : std::nullopt;
  if (edit.moving) {
    edit.moving->similarity = dragged(edit.moving->gizmo, edit.moving->handle, camera, edit.moving->from, pointer.at);
    if (!pointer.down) endMoving(state);
    taken.button = true;
    return taken;
  }
  if (edit.selecting) {
    goOnSelecting(state, pointer, camera, !pointer.down);
    if (!pointer.down) edit.selecting.reset();
    taken.button = true;
    return taken;
  }
  if (!pointer.over) return taken;
  if (selects(edit.tool)) {
    if (pointer.wheel != 0 && !pointer.control && edit.tool != EditTool::rectangle) {
      const double factor = std::pow(kWheelRadius, pointer.wheel);
      if (edit.tool == EditTool::brush) edit.brush = std::clamp(edit.brush * factor, kMinBrush, kMaxBrush);
      if (edit.tool == EditTool::sphere) edit.sphere = std::clamp(edit.sphere * factor, kMinSphere, kMaxSphere);
      taken.wheel = true;
    }
    if (edit.tool == EditTool::sphere && moved && state.scene.model->size() <= kHoverGaussians) {
      findSurface(state, camera, pointer.at);
    }
    if (pointer.pressed) {
      beginSelecting(state, pointer, camera);
      goOnSelecting(state, pointer, camera, !pointer.down);
      if (!pointer.down) edit.selecting.reset();
    }
    taken.button = taken.button || pointer.pressed;
    return taken;
  }
  const std::optional<Gizmo> gizmo = shownGizmo(state, camera);
  edit.hovered = gizmo ? handleAt(*gizmo, camera, pointer.at) : Handle::none;
  if (pointer.pressed && edit.hovered != Handle::none) {
    edit.moving = GizmoDrag{*gizmo, edit.hovered, pointer.at, {}};
    taken.button = true;
  }
  return taken;
}

}  // namespace tg
