// SPDX-License-Identifier: Apache-2.0
// Which local axes carry a texture.
#include "converter/gltf/plane_order.h"

#include "converter/gltf/axes.h"
#include "core/system/assert.h"
#include "shared/splat.h"

namespace tg {
namespace {

// Column k of the result is column order[k] of q's matrix; column `normal` of the result is turned if need be.
glm::vec4 permuted(glm::vec4 q, glm::ivec3 order, int normal) {
  const glm::dmat3 from = matrixFromQuaternion(glm::dvec4(q));
  glm::dmat3 to(from[order.x], from[order.y], from[order.z]);
  if (glm::determinant(to) < 0.0) to[normal] = -to[normal];
  return glm::vec4(quaternionFromMatrix(to));
}

}  // namespace

void orderAxesForGltf(glm::vec3& log_scale, glm::vec4& rotation) {
  const int c = shortestAxis(glm::exp(log_scale));
  if (c == 2) return;
  const glm::ivec3 order(axisU(c), axisV(c), c);
  const glm::vec3 before = log_scale;
  log_scale = {before[order.x], before[order.y], before[order.z]};
  rotation = permuted(rotation, order, 2);
}

bool orderAxesForModel(glm::vec3& log_scale, glm::vec4& rotation) {
  const float shorter = glm::min(log_scale.x, log_scale.y);
  if (log_scale.z < shorter - kTieMargin) return true;
  if (log_scale.z > shorter) return false;
  putNormalFirst(log_scale, rotation, 2);
  return true;
}

void putNormalFirst(glm::vec3& log_scale, glm::vec4& rotation, int normal) {
  TG_ASSERT(normal >= 0 && normal < 3, "one of three axes");
  const glm::ivec3 order(normal, axisU(normal), axisV(normal));
  const glm::vec3 before = log_scale;
  log_scale = {before[order.x], before[order.y], before[order.z]};
  rotation = permuted(rotation, order, 0);
}

}  // namespace tg
