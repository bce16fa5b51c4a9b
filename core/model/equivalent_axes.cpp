// SPDX-License-Identifier: Apache-2.0
#include "core/model/equivalent_axes.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <glm/gtc/quaternion.hpp>
#include <vector>

#include "core/system/assert.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

// New axis k is old axis from[k], or its opposite.
struct Renaming {
  glm::dquat turn;  // from new axes to old ones
  std::array<int, 3> from;
};

glm::dquat quaternion(glm::dvec4 q) { return {q.x, q.y, q.z, q.w}; }  // w, x, y, z as the model has them

// As quaternions one, two or four components of the same size, the first of them not negative; no turn comes first.
std::vector<Renaming> turnsOfCube() {
  std::vector<Renaming> turns;
  for (int code = 1; code < 81; ++code) {
    glm::dvec4 q(0);
    for (int k = 0, rest = code; k < 4; ++k, rest /= 3) q[k] = (rest + 1) % 3 - 1;
    int first = 0;
    while (q[first] == 0) ++first;
    if (q[first] < 0 || glm::dot(q, q) == 3) continue;
    Renaming renaming{glm::normalize(quaternion(q)), {}};
    const glm::dmat3 axes = glm::mat3_cast(renaming.turn);
    for (int k = 0; k < 3; ++k) {
      while (std::abs(axes[k][renaming.from[k]]) < 0.5) ++renaming.from[k];
    }
    turns.push_back(renaming);
  }
  TG_ASSERT(turns.size() == 24, "as many as a cube has");
  return turns;
}

}  // namespace

void renameAxesTowards(GaussianModel& model, std::span<const glm::vec4> towards) {
  TG_ASSERT(towards.size() == model.size(), "a rotation for each Gaussian");
  static const std::vector<Renaming> kTurns = turnsOfCube();
  parallelFor(static_cast<std::int64_t>(model.size()), 1024, [&](std::int64_t i) {
    if (!model.atlas.rects.empty() && model.atlas.rects[i].texelCount() > 0) return;
    const glm::dquat old = glm::normalize(quaternion(model.rotation[i])), wanted = quaternion(towards[i]);
    const Renaming* best = nullptr;
    double nearest = std::abs(glm::dot(old, wanted)) * (1 + 1e-9);  // what changes nothing wins ties
    for (const Renaming& renaming : kTurns) {
      const double near = std::abs(glm::dot(old * renaming.turn, wanted));
      if (near <= nearest) continue;
      nearest = near;
      best = &renaming;
    }
    if (!best) return;
    const glm::dquat renamed = old * best->turn;
    model.rotation[i] = glm::vec4(renamed.w, renamed.x, renamed.y, renamed.z);
    const glm::vec3 scale = model.log_scale[i];
    model.log_scale[i] = {scale[best->from[0]], scale[best->from[1]], scale[best->from[2]]};
  });
}

void renameAxesForCoding(GaussianModel& model) {
  const std::vector<glm::vec4> none(model.size(), glm::vec4(1, 0, 0, 0));
  renameAxesTowards(model, none);
}

}  // namespace tg
