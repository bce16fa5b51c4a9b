// SPDX-License-Identifier: Apache-2.0
// A Gaussian's numbers as glTF has them: what the writer stores, and what the reader holds the kept source numbers
// against.
#pragma once
#include <glm/glm.hpp>

#include "converter/formats/repair.h"
#include "converter/gltf/axes.h"
#include "core/model/verbs.h"

namespace tg {

// glTF has no word for what a splat PLY stores: quaternions of any length, logarithms of scales, logits of opacities.
// The way through exp and back loses their last bits, so the writer keeps them in these attributes where it matters.
inline constexpr const char* kSourceRotation = "_TG_SOURCE_ROTATION";    // VEC4, w x y z, the model's axes
inline constexpr const char* kSourceLogScale = "_TG_SOURCE_LOG_SCALE";   // VEC3, local axes in the model's order
inline constexpr const char* kSourceLogit = "_TG_SOURCE_OPACITY_LOGIT";  // SCALAR

// w, x, y, z, of unit length, in glTF's axes.
inline glm::vec4 gltfRotation(glm::vec4 q) { return gltfFromModelRotation(glm::vec4(glm::normalize(glm::dvec4(q)))); }

inline glm::vec3 gltfScale(glm::vec3 log_scale) {
  glm::vec3 scale;
  for (int k = 0; k < 3; ++k) scale[k] = scaleFromLog(log_scale[k]);
  return scale;
}

inline float gltfOpacity(float logit) { return static_cast<float>(sigmoid(logit)); }

}  // namespace tg
