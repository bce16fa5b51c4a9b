// SPDX-License-Identifier: Apache-2.0
// The CPU's gradients against the float64 reference, and that they do not depend on the number of threads.
#include "training/step/gradient.h"

#include <hwy/targets.h>

#include <cmath>

#include "core/system/error.h"
#include "core/system/parallel.h"
#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/gradients.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

ModelGradient gradientCpu(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                          const std::vector<glm::dvec3>& weights, const GradientOptions& options = {}) {
  return gradientOf(*makeCpuDifferentiableRenderer(), model, camera, settings, weights, options);
}

void checkCpu(const GaussianModel& model, const Camera& camera, const RenderSettings& settings) {
  const auto weights = randomWeights(camera, 2);
  checkAgainstReference(gradientCpu(model, camera, settings, weights), model, camera, settings, weights);
}

}  // namespace

// The bound is the project's for ordinary scenes; the hardest kind (edge-on, plane model) reaches 7e-5.
TEST_CASE("gradients equal the reference's on every kind of scene, in both models") {
  checkEveryScene([] { return makeCpuDifferentiableRenderer(); });
}

TEST_CASE("gradients equal the reference's in every texture mode") {
  checkEveryTextureMode([] { return makeCpuDifferentiableRenderer(); });
}

TEST_CASE("gradients equal the reference's where nothing is drawn beyond textures") {
  checkClippedTextures([] { return makeCpuDifferentiableRenderer(); });
}

TEST_CASE("gradients equal the reference's where rays lie in the plane of a Gaussian") {
  checkRaysInPlane([] { return makeCpuDifferentiableRenderer(); });
}

TEST_CASE("gradients equal the reference's for every SIMD target of this machine") {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    INFO(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    for (const SceneKind kind : {SceneKind::ordinary, SceneKind::oddTextures}) {
      TestScene scene = makeScene(kind, 3);
      for (const auto outside : {TextureOutside::base, TextureOutside::clip}) {
        scene.model.outside = outside;
        checkCpu(scene.model, scene.camera, {});
      }
    }
    hwy::SetSupportedTargetsForTest(0);
  }
}

// A 2 x 2 texture's coordinate there, -3 (1 / 6) + 0.5 in floats, is below 0: the first cell all the same.
TEST_CASE("gradients equal the reference's where pixels fall onto the border of a texture") {
  Camera camera;
  camera.size = {64, 64};
  camera.focal = {64, 64};
  camera.center = {32.5, 32.5};
  GaussianModel model;  // 8 px a sigma: pixels at -3, 3 sigma to the last bit, on either axis
  model.mean = {glm::vec3(0, 0, 8)};
  model.rotation = {glm::vec4(1, 0, 0, 0)};
  model.log_scale = {glm::vec3(0, 0, -3)};
  model.opacity_logit = {6.0f};
  model.sh = {glm::vec3(0.5f)};
  model.intersection = IntersectionModel::plane;
  model.texture_mode = TextureMode::rgba;
  Random random(8);
  for (const auto& [width, height] :
       {std::pair{2, 2}, std::pair{3, 3}, std::pair{2, 3}, std::pair{3, 1}, std::pair{4, 4}}) {
    CAPTURE(width, height);
    model.atlas = makeUniformAtlas(1, width, height);
    for (glm::vec4& texel : model.atlas.texels) texel = {random.uniformVec3(-0.5, 0.5), random.uniform(0.2, 1.0)};
    for (const auto outside : {TextureOutside::base, TextureOutside::clip}) {
      model.outside = outside;
      checkCpu(model, camera, {});
    }
  }
}

TEST_CASE("gradients have the same bytes for any number of threads") {
  const TestScene scene = makeScene(SceneKind::mixed, 4, 300, 100, 80);
  const auto weights = randomWeights(scene.camera, 2);
  setThreadCount(1);
  const ModelGradient one = gradientCpu(scene.model, scene.camera, {}, weights);
  for (const int threads : {2, 3, 8}) {
    setThreadCount(threads);
    CHECK(sameBytes(gradientCpu(scene.model, scene.camera, {}, weights), one));
  }
  setThreadCount(0);
}

TEST_CASE("gradients have the same bytes however few texel gradients are kept at once") {
  const TestScene scene = makeScene(SceneKind::oddTextures, 9, 300, 100, 80);
  const auto weights = randomWeights(scene.camera, 2);
  const ModelGradient all = gradientCpu(scene.model, scene.camera, {}, weights);
  for (const std::size_t limit : {std::size_t{0}, std::size_t{1000}, std::size_t{20000}}) {
    const auto renderer = makeCpuDifferentiableRenderer(limit);
    renderer->forward(scene.model, scene.camera, {});
    ModelGradient rounds;
    renderer->backward(std::vector<glm::vec3>(weights.begin(), weights.end()), rounds);
    CHECK(sameBytes(rounds, all));
  }
}

TEST_CASE("the picture of a forward pass is the renderer's") {
  TestScene scene = makeScene(SceneKind::mixed, 5);
  for (const auto outside : {TextureOutside::base, TextureOutside::clip}) {
    scene.model.outside = outside;
    const auto renderer = makeCpuRenderer();
    renderer->setModel(scene.model);
    const Frame frame = renderer->render(scene.camera, {});
    const auto differentiable = makeCpuDifferentiableRenderer();
    const auto& picture = differentiable->forward(scene.model, scene.camera, {});
    REQUIRE(picture.size() == frame.base.size());
    for (std::size_t pixel = 0; pixel < picture.size(); ++pixel) {
      REQUIRE(glm::length(picture[pixel] - frame.color(pixel)) < 1e-5f);
    }
  }
}

TEST_CASE("each ablation of the exact gradients equals the reference's, and changes the gradient") {
  const TestScene scene = makeScene(SceneKind::ordinary, 7);
  const auto weights = randomWeights(scene.camera, 2);
  const ReferenceModel reference(scene.model);
  const BlockErrors exact = compare(gradientCpu(scene.model, scene.camera, {}, weights),
                                    backwardReference(reference, scene.camera, {}, weights));
  for (const bool suffix : {false, true}) {
    GradientOptions options;
    (suffix ? options.texture_in_suffix : options.texture_to_geometry) = false;
    ReferenceOptions reference_options;
    reference_options.texture_in_suffix = options.texture_in_suffix;
    reference_options.texture_to_geometry = options.texture_to_geometry;
    INFO((suffix ? "suffix" : "geometry"));
    const ReferenceGradient expected = backwardReference(reference, scene.camera, {}, weights, reference_options);
    const BlockErrors same = compare(gradientCpu(scene.model, scene.camera, {}, weights, options), expected);
    CHECK(same.mean < 1e-4);
    CHECK(same.rotation < 1e-4);
    CHECK(same.log_scale < 1e-4);
    CHECK(same.opacity_logit < 1e-4);
    CHECK(same.texels < 1e-4);
    CHECK(same.screen_abs < 1e-4);
    CHECK(exact.mean < 1e-4);
    const BlockErrors other = compare(gradientCpu(scene.model, scene.camera, {}, weights), expected);
    CHECK(other.mean > 1e-2);
    CHECK(other.log_scale > 1e-2);
  }
}

TEST_CASE("without statistics everything but the sum of magnitudes has the same bytes") {
  const TestScene scene = makeScene(SceneKind::mixed, 8);
  const auto weights = randomWeights(scene.camera, 2);
  ModelGradient with = gradientCpu(scene.model, scene.camera, {}, weights);
  GradientOptions options;
  options.statistics = false;
  const ModelGradient without = gradientCpu(scene.model, scene.camera, {}, weights, options);
  CHECK(without.screen_gradient_abs == std::vector<float>(scene.model.size(), 0.0f));
  CHECK_FALSE(sameBytes(with, without));
  with.screen_gradient_abs = without.screen_gradient_abs;
  CHECK(sameBytes(with, without));
}

TEST_CASE("alpha texels outside [0, 1] get no gradient") {
  TestScene scene = makeScene(SceneKind::ordinary, 6);
  for (std::size_t i = 0; i < scene.model.atlas.texels.size(); i += 2) scene.model.atlas.texels[i].a = -0.1f;
  const auto gradient = gradientCpu(scene.model, scene.camera, {}, randomWeights(scene.camera, 2));
  float inside = 0.0f;
  for (std::size_t i = 0; i < gradient.texels.size(); ++i) {
    if (i % 2 == 0) {
      REQUIRE(gradient.texels[i].a == 0.0f);
    } else {
      inside += std::abs(gradient.texels[i].a);
    }
  }
  CHECK(inside > 0.0f);
}

TEST_CASE("backward without forward, with another size, or of what has no gradient, is a usage error") {
  TestScene scene = makeScene(SceneKind::ordinary, 1, 5);
  const auto renderer = makeCpuDifferentiableRenderer();
  ModelGradient gradient;
  CHECK_THROWS_AS(renderer->backward({}, gradient), Error);
  renderer->forward(scene.model, scene.camera, {});
  CHECK_THROWS_AS(renderer->backward(std::vector<glm::vec3>(7), gradient), Error);
  scene.model.outside = TextureOutside::edge;
  const std::vector<glm::vec3> picture = renderer->forward(scene.model, scene.camera, {});
  CHECK_THROWS_WITH(renderer->backward(picture, gradient), "outside edge: not supported by the backward pass");
}
