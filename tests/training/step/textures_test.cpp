// SPDX-License-Identifier: Apache-2.0
// Texture rectangles keep their budget; the first texels.
#include "training/step/textures.h"

#include <cmath>
#include <vector>

#include "support/catch.h"

TEST_CASE("rectangles keep to the texel budget", "[textures]") {
  CHECK(tg::uniformRects(10, 4, 0)[9].texelCount() == 16);
  CHECK(tg::uniformRects(10, 4, 1000)[0].width == 10);
  CHECK(tg::uniformRects(10, 4, 3)[0].texelCount() == 1);

  tg::GaussianModel model;
  std::vector<float> pixel_sizes;
  for (int i = 0; i < 200; ++i) {
    model.mean.emplace_back(0);
    model.log_scale.emplace_back(std::log(0.01f * static_cast<float>(i % 20 + 1)), std::log(0.005f), std::log(0.03f));
    pixel_sizes.push_back(i < 100 ? 0.01f : 0.02f);
  }
  const std::vector<tg::TextureRect> rects = tg::footprintRects(model, pixel_sizes, 3200);
  std::size_t texels = 0;
  for (const tg::TextureRect& rect : rects) texels += rect.texelCount();
  CHECK(texels <= 3200);
  CHECK(texels > 3000);
  // i = 19: scales 0.2 along x and 0.03 along z (y is the shortest, dropped).
  CHECK(static_cast<double>(rects[19].width) / rects[19].height == Approx(0.2 / 0.03).epsilon(0.15));
  CHECK(rects[19].width == Approx(2.0 * rects[119].width).margin(1.1));  // half as far, twice the pixels
  for (const tg::TextureRect& rect : tg::footprintRects(model, pixel_sizes, 10)) CHECK(rect.texelCount() == 1);
}

TEST_CASE("the paper's first texels leave the constant colour where it was", "[textures]") {
  tg::TrainingState state;
  state.model.mean = {{0, 0, 0}};
  state.model.rotation = {{1, 0, 0, 0}};
  state.model.log_scale = {{0, 0, 0}};
  state.model.opacity_logit = {0};
  state.model.sh = {{1, 2, 3}};
  tg::addTextures(state, tg::uniformRects(1, 3, 0), tg::TextureMode::rgba, tg::TextureInit::paper);
  CHECK(state.model.atlas.texels.size() == 9);
  CHECK(state.model.atlas.texels[4].g == Approx(25.0 / 255));
  CHECK(state.model.atlas.texels[4].a == 1);
  CHECK(0.28209479177387814 * (1 - state.model.sh[0].r) == Approx(25.0 / 255));
}
