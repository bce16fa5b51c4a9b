// SPDX-License-Identifier: Apache-2.0
// Linear scales of splat files as the model's logarithms, those without one included.
#pragma once
#include <cmath>
#include <cstddef>
#include <glm/glm.hpp>
#include <string>
#include <vector>

namespace tg {

constexpr float kZeroScaleFraction =
    1e-4f;                             // a scale of 0 has no logarithm: this part of the smallest other one instead
constexpr float kPointScale = 1e-10f;  // [world units] when all three are 0

// scale >= 0.
inline glm::vec3 logFromScale(glm::vec3 scale) {
  float smallest = 0.0f;
  for (int k = 0; k < 3; ++k) {
    if (scale[k] > 0.0f && (smallest == 0.0f || scale[k] < smallest)) smallest = scale[k];
  }
  const float zero = std::max(smallest * kZeroScaleFraction, kPointScale);
  glm::vec3 log_scale;
  for (int k = 0; k < 3; ++k) {
    log_scale[k] = static_cast<float>(std::log(static_cast<double>(scale[k] > 0.0f ? scale[k] : zero)));
  }
  return log_scale;
}

// One line for the summary when `count` splats were put right.
inline void warnRepair(std::vector<std::string>& warnings, std::size_t count, const std::string& what) {
  if (count != 0) warnings.push_back(std::to_string(count) + " splats " + what);
}

}  // namespace tg
