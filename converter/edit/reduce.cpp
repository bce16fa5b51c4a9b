// SPDX-License-Identifier: Apache-2.0
// Takes from what every Gaussian carries.
#include "converter/edit/reduce.h"

#include <algorithm>
#include <cstdint>
#include <string>

#include "converter/edit/texture_fit.h"
#include "converter/gltf/fallback.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {

void setShDegree(GaussianModel& model, int degree) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  if (degree < 0 || degree > 3) {
    throw Error(ErrorKind::usage, "wrong SH degree (expected 0 to 3, found " + std::to_string(degree) + ")");
  }
  if (degree == model.sh_degree) return;
  const std::size_t before = static_cast<std::size_t>(model.shCount());
  model.sh_degree = degree;
  const std::size_t after = static_cast<std::size_t>(model.shCount());
  std::vector<glm::vec3> sh(model.size() * after, glm::vec3(0.0f));
  for (std::size_t i = 0; i < model.size(); ++i) {
    std::copy_n(model.sh.begin() + static_cast<std::ptrdiff_t>(i * before), std::min(before, after),
                sh.begin() + static_cast<std::ptrdiff_t>(i * after));
  }
  model.sh = std::move(sh);
}

void resizeTextures(GaussianModel& model, int width, int height) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  constexpr int kMaxSide = 1024;
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide) {
    throw Error(ErrorKind::usage, "wrong texture size (expected 1 to " + std::to_string(kMaxSide) + " a side, found " +
                                      std::to_string(width) + " x " + std::to_string(height) + ")");
  }
  const TextureAtlas from = std::move(model.atlas);
  std::vector<glm::ivec2> sizes(from.rects.size());
  for (std::size_t i = 0; i < from.rects.size(); ++i) {
    if (from.rects[i].texelCount() != 0) sizes[i] = {width, height};
  }
  model.atlas = resizedAtlas(from, sizes);
}

void dropTextures(GaussianModel& model) { model = bakeFallback(model); }

}  // namespace tg
