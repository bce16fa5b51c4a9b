// SPDX-License-Identifier: Apache-2.0
// The splats under one pixel, printed.
#include "viewer/headless/headless.h"

#include <cstdio>
#include <memory>

#include "core/system/error.h"
#include "render/reference/inspect.h"
#include "viewer/headless/renderer.h"
#include "viewer/view/inspection.h"
#include "viewer/view/shot.h"

namespace tg {

void inspectHeadless(const ViewOptions& options) {
  ViewedScene viewed(options, options.model);
  const Scene& scene = viewed.scene();
  const Camera camera = cameraFor(options, scene);
  const glm::ivec2 pixel = *options.inspect;
  if (pixel.x >= camera.size.x || pixel.y >= camera.size.y) {
    throw Error(ErrorKind::usage, "--inspect: expected a pixel of the " + std::to_string(camera.size.x) + "x" +
                                      std::to_string(camera.size.y) + " picture, found " + std::to_string(pixel.x) +
                                      "," + std::to_string(pixel.y));
  }
  const RenderSettings settings = settingsFor(options, scene.background);
  const std::shared_ptr<const GaussianModel> model = viewed.modelFor(camera);
  const std::vector<PixelHit> hits = inspectPixel(*model, camera, settings, pixel);
  std::fputs(formatInspection(*model, camera, settings, pixel, hits).c_str(), stdout);
}

}  // namespace tg
