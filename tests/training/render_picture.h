// SPDX-License-Identifier: Apache-2.0
// The picture of a model as an image, by a training's renderer.
#pragma once
#include "training/score/evaluate.h"
#include "training/step/gradient.h"

namespace tg::test {

inline Image renderPicture(DifferentiableRenderer& renderer, const GaussianModel& model, const Camera& camera,
                           const glm::vec3& background) {
  RenderSettings settings;
  settings.background = background;
  return imageOf(renderer.forward(model, camera, settings), camera);
}

}  // namespace tg::test
