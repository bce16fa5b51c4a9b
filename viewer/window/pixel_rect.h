// SPDX-License-Identifier: Apache-2.0
// A part of the window.
#pragma once
#include <glm/glm.hpp>

namespace tg {

// [px] of the window, top left first.
struct PixelRect {
  glm::ivec2 origin{0};
  glm::ivec2 size{0};
};

}  // namespace tg
