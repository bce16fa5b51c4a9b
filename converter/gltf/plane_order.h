// SPDX-License-Identifier: Apache-2.0
// Which local axes carry a texture: the model finds them by sorting scales (docs/math.md), glTF by their place.
#pragma once
#include <glm/glm.hpp>

namespace tg {

// Permutes local axes so that x = u, y = v and z = normal, for one Gaussian; the handedness is kept by
// turning the normal, whose sign means nothing. Textures stay as they are.
void orderAxesForGltf(glm::vec3& log_scale, glm::vec4& rotation);

// The same Gaussian with axes that the model's rule maps back to u = x, v = y: unchanged where z is clearly the
// shortest, (z, x, y) where it ties. False when z is not the shortest: the rule then picks other axes.
bool orderAxesForModel(glm::vec3& log_scale, glm::vec4& rotation);

// Scales closer than this are taken for a tie: backends compare exp(log_scale) in float, each with its own rounding.
constexpr float kTieMargin = 1e-5f;  // of ln(sigma)

// The same Gaussian with its normal, local axis `normal`, as x and u, v as y, z: what the model's rule finds even where
// the normal's scale equals others.
void putNormalFirst(glm::vec3& log_scale, glm::vec4& rotation, int normal);

}  // namespace tg
