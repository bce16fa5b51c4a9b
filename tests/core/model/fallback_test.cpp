// SPDX-License-Identifier: Apache-2.0
#include "core/model/fallback.h"

#include <functional>
#include <vector>

#include "core/model/verbs.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;

namespace {

// Alpha 1 in the middle 4 x 4 of 8 x 8 texels, 0 around: what most Gaussians of a scene choose.
constexpr int kSide = 8;
glm::vec4 kernelTexel(int t) {
  const int u = t % kSide, v = t / kSide;
  return {0, 0, 0, u >= 2 && u < 6 && v >= 2 && v < 6 ? 1 : 0};
}

GaussianModel withTextures(const std::function<glm::vec4(int)>& texel) {
  GaussianModel model = test::makeScene(test::SceneKind::ordinary, 31, 40).model;
  model.texture_mode = TextureMode::rgba;
  model.atlas = makeUniformAtlas(model.size(), kSide, kSide);
  for (std::size_t t = 0; t < model.atlas.texels.size(); ++t) {
    model.atlas.texels[t] = texel(static_cast<int>(t % (kSide * kSide)));
  }
  return model;
}

}  // namespace

TEST_CASE("a texture that lets only the middle show is a smaller Gaussian in the base, hardly a fainter one") {
  const GaussianModel model = withTextures(kernelTexel);
  const GaussianModel base = bakeFallback(model, FallbackScale::fitted);
  const GaussianModel fainter = bakeFallback(model, FallbackScale::kept);
  CHECK(base.texture_mode == TextureMode::none);
  for (std::size_t i = 0; i < model.size(); ++i) {
    CHECK(fainter.log_scale[i] == model.log_scale[i]);
    CHECK(opacityOf(fainter, i) / opacityOf(model, i) == Approx(0.832).margin(0.001));
    for (int k = 0; k < 3; ++k) CHECK(base.log_scale[i][k] - model.log_scale[i][k] == Approx(-0.0625).margin(1e-5));
    CHECK(opacityOf(base, i) / opacityOf(model, i) == Approx(0.943).margin(0.001));
  }
}

TEST_CASE("a texture that is as thin everywhere is a fainter Gaussian in the base, of the same size") {
  const GaussianModel model = withTextures([](int t) { return glm::vec4(0.1, 0, 0, (t + t / kSide) % 2 ? 0.5 : 0.1); });
  const GaussianModel base = bakeFallback(model, FallbackScale::fitted);
  for (std::size_t i = 0; i < model.size(); ++i) {
    CHECK(base.log_scale[i] == model.log_scale[i]);
    CHECK(opacityOf(base, i) / opacityOf(model, i) == Approx(0.3).margin(0.01));
    CHECK(base.sh[i * base.shCount()].r - model.sh[i * model.shCount()].r == Approx(0.1 / kShC0).margin(1e-4));
  }
}

TEST_CASE("a base of texels as bright as floats reach is finite") {
  const GaussianModel base =
      bakeFallback(withTextures([](int) { return glm::vec4(1e38f, -1e38f, 0.5f, 1.0f); }), FallbackScale::fitted);
  CHECK_NOTHROW(checkModel(base, "base"));
}

TEST_CASE("the mean colours of textures are what the base adds to DC and 0 of what has no colour") {
  test::Random random(13);
  GaussianModel model =
      withTextures([&](int) { return glm::vec4(random.uniformVec3(-0.5, 0.5), random.uniform(0.0, 1.0)); });
  model.atlas.rects[3] = {};
  const GaussianModel base = bakeFallback(model, FallbackScale::fitted);
  const std::vector<glm::vec3> colors = meanTextureColors(model);
  REQUIRE(colors.size() == model.size());
  for (std::size_t i = 0; i < model.size(); ++i) {
    const std::size_t dc = i * model.shCount();
    CHECK(base.sh[dc] == model.sh[dc] + colors[i]);
    CHECK((colors[i] == glm::vec3(0.0f)) == (i == 3));
  }
  model.texture_mode = TextureMode::alpha;
  CHECK(meanTextureColors(model) == std::vector<glm::vec3>(model.size(), glm::vec3(0.0f)));
  CHECK(meanTextureColors(withoutTextures(model)) == std::vector<glm::vec3>(model.size(), glm::vec3(0.0f)));
}

TEST_CASE("what stands in for textures comes off again") {
  test::Random random(12);
  const GaussianModel odd =
      withTextures([&](int) { return glm::vec4(random.uniformVec3(-0.5, 0.5), random.uniform(0.0, 1.0)); });
  const GaussianModel none = withTextures([](int) { return glm::vec4(0.0f); });  // nothing shows
  for (const GaussianModel& model : {odd, withTextures(kernelTexel), none}) {
    for (const auto scale : {FallbackScale::kept, FallbackScale::fitted}) {
      GaussianModel again = bakeFallback(model, scale);
      again.texture_mode = model.texture_mode;
      again.atlas = model.atlas;
      removeFallback(again, scale);
      for (std::size_t i = 0; i < model.size(); ++i) {
        CHECK(glm::length(again.log_scale[i] - model.log_scale[i]) < 1e-5f);
        CHECK(glm::length(again.sh[i * again.shCount()] - model.sh[i * model.shCount()]) < 1e-5f);
        if (model.atlas.texels[27].a > 0) CHECK(opacityOf(again, i) == Approx(opacityOf(model, i)).epsilon(1e-4));
      }
    }
  }
}
