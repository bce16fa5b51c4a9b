// SPDX-License-Identifier: Apache-2.0
// A model's numbers, counted once.
#include "viewer/view/scene.h"

#include "core/system/assert.h"

namespace tg {

void measure(Scene& scene) {
  TG_ASSERT(scene.model != nullptr, "a scene has its model");
  const GaussianModel& model = *scene.model;
  scene.gaussians = model.size();
  scene.textured = scene.texels = 0;
  for (const TextureRect& rect : model.atlas.rects) {
    scene.textured += rect.texelCount() > 0;
    scene.texels += rect.texelCount();
  }
  scene.sh_degree = model.sh_degree;
  scene.texture_mode = model.texture_mode;
  scene.intersection = model.intersection;
  scene.outside = model.outside;
  scene.bounds = sceneBounds(model);
}

}  // namespace tg
