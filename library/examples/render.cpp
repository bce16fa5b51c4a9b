// SPDX-License-Identifier: Apache-2.0
// Draws what a model's first camera sees: `render MODEL OUT.png`.
#include <cstdio>

#include "textured_gaussians/textured_gaussians.h"

namespace tg = textured_gaussians;

int main(int count, char** arguments) try {
  if (count != 3) return 1;
  const tg::Model model = tg::Model::load(arguments[1]);
  const tg::Camera camera =
      model.cameras().empty() ? tg::lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 512, 512) : model.cameras().front();
  tg::Renderer renderer(model);
  tg::writeImage(arguments[2], renderer.render(camera));
  const tg::Image depth = renderer.render(camera, tg::Output::depth);
  std::printf("%zu Gaussians, %d x %d pixels, depth in the middle %.3f\n", model.size(), camera.width, camera.height,
              depth.data[static_cast<std::size_t>(camera.height / 2 * camera.width + camera.width / 2)]);
} catch (const tg::Error& error) {
  std::fprintf(stderr, "render: %s\n", error.what());
  return static_cast<int>(error.kind());
}
