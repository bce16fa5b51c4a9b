// SPDX-License-Identifier: Apache-2.0
// The pointer in the picture while an edit tool is on.
#pragma once
#include <glm/glm.hpp>

#include "viewer/view/state.h"

namespace tg {

// What the pointer did since the last frame, in the pixels of the camera that the tool works with.
struct EditPointer {
  glm::dvec2 at{0.0};
  bool over = false;                   // on the picture, and nothing else wants it
  bool pressed = false, down = false;  // the left button
  double wheel = 0;                    // [notches]
  bool shift = false, control = false;
};
struct PointerTaken {
  bool button = false, wheel = false;  // not for the camera
};
// Whether a press of the left button there is a tool's.
bool hasButton(const EditState& edit);
PointerTaken editPointer(ViewerState& state, const EditPointer& pointer, const Camera& camera);

// The handles that the state shows now; none without such a tool.
std::optional<Gizmo> shownGizmo(const ViewerState& state, const Camera& camera);

}  // namespace tg
