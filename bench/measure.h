// SPDX-License-Identifier: Apache-2.0
// What several benchmarks measure with, and what they measure on.
#pragma once
#include <sys/resource.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/model/atlas.h"
#include "core/model/model.h"
#include "support/scenes.h"

namespace tg {

// [ms] Processor time of the whole process.
inline double processorMilliseconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto milliseconds = [](const timeval& time) {
    return 1e3 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_usec);
  };
  return milliseconds(usage.ru_utime) + milliseconds(usage.ru_stime);
}

// Of at least one value.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Every Gaussian a texture of its own, the same on every machine.
inline void addTextures(GaussianModel& model, int width, int height) {
  test::Random random(3);
  model.texture_mode = TextureMode::rgba;
  model.atlas = makeUniformAtlas(model.size(), width, height);
  for (glm::vec4& texel : model.atlas.texels) {
    texel = glm::vec4(glm::vec3(random.uniformVec3(-0.2, 0.2)), random.uniform(0.5, 1.0));
  }
}

}  // namespace tg
