// SPDX-License-Identifier: Apache-2.0
// Which local axes carry a texture: the model finds them by sorting scales (docs/math.md), glTF by their place.
#pragma once
#include <glm/glm.hpp>
#include <vector>

namespace tg {

// Permutes local axes so that x = u, y = v and z = normal, for one Gaussian or for every one; the handedness is kept by
// turning the normal, whose sign means nothing. Textures stay as they are.
void orderAxesForGltf(glm::vec3& log_scale, glm::vec4& rotation);
void orderAxesForGltf(std::vector<glm::vec3>& log_scale, std::vector<glm::vec4>& rotation);

// The same Gaussian with axes that the model's rule maps back to u = x, v = y: unchanged where z is clearly the
// shortest, (z, x, y) where it ties. False when z is not the shortest: the rule then picks other axes.
bool orderAxesForModel(glm::vec3& log_scale, glm::vec4& rotation);

}  // namespace tg
