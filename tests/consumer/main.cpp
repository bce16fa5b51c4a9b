// SPDX-License-Identifier: Apache-2.0
// Draws a model's first camera: `consumer MODEL OUT.png`.
#include "textured_gaussians/textured_gaussians.h"

int main(int count, char** arguments) {
  if (count != 3) return 1;
  const auto model = textured_gaussians::Model::load(arguments[1]);
  textured_gaussians::Renderer renderer(model);
  textured_gaussians::writeImage(arguments[2], renderer.render(model.cameras().at(0)));
}
