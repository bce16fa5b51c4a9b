// SPDX-License-Identifier: Apache-2.0
// Handles in the picture that move, turn and scale: where they lie, which of them the pointer meets, and what dragging
// one does. Pure functions.
#pragma once
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "converter/edit/transform.h"
#include "core/model/camera.h"
#include "core/system/names.h"

namespace tg {

enum class GizmoKind { move, turn, scale };
// Along or about a world axis, or the view's: in the plane of the picture, about the view's direction.
enum class Handle { none, x, y, z, view };

struct Gizmo {
  GizmoKind kind = GizmoKind::move;
  glm::dvec3 origin{0.0};  // world
  double size = 1;         // [world units] of an axis; about as many pixels everywhere
  double unit = 1;         // [px] of what one is at 96 dpi
};

// None where the point lies behind the camera, or so near that it has no place in the picture.
std::optional<Gizmo> gizmoAt(GizmoKind kind, glm::dvec3 origin, const Camera& camera, double unit = 1);

// A line of a handle in the image [px]. Square dots are where scaling and moving in the picture's plane begin.
struct GizmoLine {
  std::vector<glm::dvec2> points;
  Handle handle = Handle::none;
  bool arrow = false;  // at its end
};
std::vector<GizmoLine> gizmoLines(const Gizmo& gizmo, const Camera& camera);
// At that place of the image [px].
Handle handleAt(const Gizmo& gizmo, const Camera& camera, glm::dvec2 at);
// What a drag of the handle from one place of the image to another does, in world space.
Similarity dragged(const Gizmo& gizmo, Handle handle, const Camera& camera, glm::dvec2 from, glm::dvec2 to);
// "x +0.25", "37.5 degrees", "x 1.20".
std::string dragText(const Gizmo& gizmo, Handle handle, const Similarity& similarity);

}  // namespace tg
