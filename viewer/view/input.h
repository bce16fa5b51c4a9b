// SPDX-License-Identifier: Apache-2.0
// Mouse and held keys, as changes of the camera.
#pragma once
#include <glm/glm.hpp>

#include "viewer/view/state.h"

namespace tg {

// What the pointer and held keys did since the last frame.
struct Input {
  glm::dvec2 drag{0.0};    // [px] right, down
  double wheel = 0;        // [notches] positive: away from the user
  glm::dvec2 cursor{0.0};  // [px] right and down of the picture's middle
  bool left = false, middle = false, right = false;
  bool shift = false, control = false, alt = false;
  glm::dvec3 fly{0.0};     // right, down, forward: -1, 0 or 1
  double roll = 0;         // -1, 0 or 1
  glm::dvec2 arrows{0.0};  // right, up: -1, 0 or 1
  double seconds = 0;      // since the last frame
};
// Returns whether the camera moved. `height`: of the picture [px].
bool applyInput(ViewerState& state, const Input& input, int height);

}  // namespace tg
