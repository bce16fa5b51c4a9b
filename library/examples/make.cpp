// SPDX-License-Identifier: Apache-2.0
// Makes a model of one Gaussian with a 2 x 2 texture: `make OUT.tgz`.
#include <cstdio>

#include "textured_gaussians/textured_gaussians.h"

namespace tg = textured_gaussians;

int main(int count, char** arguments) try {
  if (count != 2) return 1;
  tg::ModelData data;
  data.means = {0, 0, 0};
  data.rotations = {1, 0, 0, 0};
  data.log_scales = {-1, -1, -5};  // flat: a disc in the plane z = 0
  data.opacity_logits = {4};
  data.sh = {0.5f, 0.5f, 0.5f};
  data.texture_mode = tg::TextureMode::rgba;
  data.texture_rects = {{.offset = 0, .width = 2, .height = 2}};
  data.texels = {0.3f, 0, 0, 1, 0, 0.3f, 0, 1, 0, 0, 0.3f, 1, 0, 0, 0, 0.2f};
  data.cameras = {tg::lookAt({0, 0, -3}, {0, 0, 0}, {0, -1, 0}, 0.8, 256, 256)};
  tg::Model(data).save(arguments[1]);
} catch (const tg::Error& error) {
  std::fprintf(stderr, "make: %s\n", error.what());
  return static_cast<int>(error.kind());
}
