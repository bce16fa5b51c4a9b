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
