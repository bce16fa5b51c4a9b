// SPDX-License-Identifier: Apache-2.0
// A context is drawn like any Gaussian, and takes no part in the gradient.
#include "training/step/context.h"

#include <vector>

#include "core/model/verbs.h"
#include "render/contribution.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg::test;

TEST_CASE("a picture with a context is that of both models, and so is the gradient of the first", "[context]") {
  const TestScene scene = makeScene(SceneKind::mixed, 3);
  const std::size_t own = 120;
  std::vector<std::uint32_t> first, second;
  for (std::uint32_t i = 0; i < scene.model.size(); ++i) (i < own ? first : second).push_back(i);
  const tg::GaussianModel model = tg::select(scene.model, first);
  const tg::GaussianModel context = tg::withoutTextures(tg::select(scene.model, second));
  tg::GaussianModel both = tg::withoutTextures(scene.model);
  both.texture_mode = model.texture_mode;
  both.atlas = model.atlas;
  both.atlas.rects.resize(both.size());

  const auto plain = tg::makeCpuDifferentiableRenderer();
  const auto surrounded = tg::withContext(tg::makeCpuDifferentiableRenderer(), context);
  const std::vector<glm::vec3> expected = plain->forward(both, scene.camera, {});
  CHECK(surrounded->forward(model, scene.camera, {}) == expected);
  CHECK(surrounded->deviceName() == plain->deviceName());
  CHECK(plain->forward(model, scene.camera, {}) != expected);

  plain->forward(both, scene.camera, {});
  const std::vector<glm::vec3> v_color(expected.size(), glm::vec3(0.3f, -0.2f, 0.1f));
  tg::ModelGradient all, own_gradient;
  plain->backward(v_color, all, {});
  for (int again = 0; again < 2; ++again) {  // the second time into what the first one left
    surrounded->backward(v_color, own_gradient, {});
    tg::forEachField(
        [&](const tg::Field& field, const auto& mine, auto values) {
          values.resize(own * field.values(model.shCount()));
          CHECK(mine == values);
        },
        own_gradient, all);
    CHECK(own_gradient.texels == all.texels);
    CHECK(own_gradient.screen_radius.size() == own);
  }

  const std::span<const tg::Camera> views(&scene.camera, 1);
  std::vector<double> weights = tg::blendWeights(both, views);
  weights.resize(own);
  CHECK(surrounded->seenWeights(model, views) == weights);
  CHECK(plain->seenWeights(model, views) != weights);  // what the context hides

  // Fewer SH of the model cut those of the context, and more bring them back.
  tg::GaussianModel low = model, low_both = both;
  tg::setShDegree(low, 1);
  tg::setShDegree(low_both, 1);
  CHECK(surrounded->forward(low, scene.camera, {}) == plain->forward(low_both, scene.camera, {}));
  CHECK(surrounded->forward(model, scene.camera, {}) == expected);
}
