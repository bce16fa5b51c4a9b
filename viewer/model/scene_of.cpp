// SPDX-License-Identifier: Apache-2.0
// A model's numbers, counted once.
#include "viewer/model/scene_of.h"

#include <cstdio>
#include <memory>
#include <utility>

#include "viewer/model/training_progress.h"

namespace tg {

Scene sceneOf(Bundle loaded, const std::filesystem::path& path) {
  const GaussianModel& model = loaded.model;
  Scene scene;
  scene.path = path;
  scene.gaussians = model.size();
  for (const TextureRect& rect : model.atlas.rects) {
    scene.textured += rect.texelCount() > 0;
    scene.texels += rect.texelCount();
  }
  scene.sh_degree = model.sh_degree;
  scene.texture_mode = model.texture_mode;
  scene.intersection = model.intersection;
  scene.background = loaded.background;
  scene.warnings = std::move(loaded.warnings);
  scene.up = sceneUp(loaded.cameras);
  scene.bounds = sceneBounds(model);
  scene.cameras = std::move(loaded.cameras);
  const TrainingProgress progress = trainingProgress(loaded.training_json);
  scene.training = formatProgress(progress);
  if (progress.psnr > 0) {
    char text[32];
    std::snprintf(text, sizeof text, ", %.2f dB in training", progress.psnr);
    scene.training += text;
  }
  scene.model = std::make_shared<const GaussianModel>(std::move(loaded.model));
  return scene;
}

Scene sceneFor(const ViewOptions& options, Bundle loaded) {
  Scene scene = sceneOf(std::move(loaded), options.model);
  scene.up = upOf(options.up, scene.up);
  return scene;
}

}  // namespace tg
