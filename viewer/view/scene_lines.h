// SPDX-License-Identifier: Apache-2.0
// Lines drawn into the scene over the picture: the camera path, the crop box, the picked Gaussian.
#pragma once
#include <glm/glm.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "viewer/view/state.h"

namespace tg {

struct SceneLine {
  glm::dvec3 a{0.0}, b{0.0};  // world
  glm::vec3 color{1.0f};
  float width = 1;  // [px]
};

// What the state shows as lines now.
std::vector<SceneLine> sceneLines(const ViewerState& state);

// A world segment in the camera's image [px]; cut at a plane before the camera, empty when it lies behind that. It may
// reach out of the image.
std::optional<std::pair<glm::dvec2, glm::dvec2>> projected(const Camera& camera, glm::dvec3 a, glm::dvec3 b);

void appendBox(std::vector<SceneLine>& lines, glm::dvec3 low, glm::dvec3 high, glm::vec3 color);

}  // namespace tg
