// SPDX-License-Identifier: Apache-2.0
// The CUDA kernels against the float64 reference and the CPU's; in every order of threads.
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/cuda_orders.h"
#include "support/gradients.h"
#include "support/scenes.h"
#include "training/cuda/renderer.h"

using namespace tg;
using namespace tg::test;

namespace {

ModelGradient gradientCuda(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                           const std::vector<glm::dvec3>& weights, const GradientOptions& options = {}) {
  return gradientOf(*makeCudaDifferentiableRenderer(), model, camera, settings, weights, options);
}

}  // namespace

TEST_CASE("CUDA pictures are the CPU's on every kind of scene, in both models") {
  for (const SceneKind kind : kSceneKinds) {
    for (const auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
      const TestScene scene = makeScene(kind, 5);
      RenderSettings settings;
      settings.intersection = intersection;
      settings.background = {0.3f, 0.1f, 0.8f};
      const auto cpu = makeCpuDifferentiableRenderer();
      const auto cuda = makeCudaDifferentiableRenderer();
      const auto& expected = cpu->forward(scene.model, scene.camera, settings);
      const auto& found = cuda->forward(scene.model, scene.camera, settings);
      INFO(name(kind) << ", " << name(intersection));
      REQUIRE(found.size() == expected.size());
      std::size_t flipped = 0;
      for (std::size_t pixel = 0; pixel < found.size(); ++pixel) {
        const float difference = glm::length(found[pixel] - expected[pixel]);
        REQUIRE(difference < 2e-2f);
        flipped += difference > 2e-4f;
      }
      CHECK(flipped <= found.size() / 1000);
    }
  }
}

TEST_CASE("CUDA gradients equal the reference's on every kind of scene, in both models") {
  checkEveryScene([] { return makeCudaDifferentiableRenderer(); });
}

TEST_CASE("CUDA gradients equal the reference's in every texture mode", "[checked]") {
  checkEveryTextureMode([] { return makeCudaDifferentiableRenderer(); });
}

TEST_CASE("CUDA gradients have the same bytes whatever the order of threads and blocks") {
  for (const SceneKind kind : {SceneKind::mixed, SceneKind::stacked}) {
    const TestScene scene = makeScene(kind, 4, 100, 50, 40);
    const auto weights = randomWeights(scene.camera, 2);
    const ModelGradient expected = gradientCuda(scene.model, scene.camera, {}, weights);
    inOtherOrders([&] { CHECK(sameBytes(gradientCuda(scene.model, scene.camera, {}, weights), expected)); });
  }
}

TEST_CASE("each ablation of CUDA's exact gradients is the CPU's") {
  const TestScene scene = makeScene(SceneKind::ordinary, 7);
  const auto weights = randomWeights(scene.camera, 2);
  for (const bool suffix : {false, true}) {
    GradientOptions options;
    (suffix ? options.texture_in_suffix : options.texture_to_geometry) = false;
    ReferenceOptions reference;
    reference.texture_in_suffix = options.texture_in_suffix;
    reference.texture_to_geometry = options.texture_to_geometry;
    checkAgainstReference(gradientCuda(scene.model, scene.camera, {}, weights, options), scene.model, scene.camera, {},
                          weights, reference);
  }
}

TEST_CASE("CUDA without statistics leaves out the sum of magnitudes alone", "[checked]") {
  const TestScene scene = makeScene(SceneKind::mixed, 8);
  const auto weights = randomWeights(scene.camera, 2);
  for (const auto mode : {TextureMode::none, TextureMode::rgba}) {
    RenderSettings settings;
    settings.textures = mode;
    ModelGradient with = gradientCuda(scene.model, scene.camera, settings, weights);
    GradientOptions options;
    options.statistics = false;
    const ModelGradient without = gradientCuda(scene.model, scene.camera, settings, weights, options);
    CHECK(without.screen_gradient_abs == std::vector<float>(scene.model.size(), 0.0f));
    with.screen_gradient_abs = without.screen_gradient_abs;
    CHECK(sameBytes(with, without));
  }
}

TEST_CASE("CUDA's screen radii and alpha mask are the CPU's") {
  TestScene scene = makeScene(SceneKind::mixed, 6);
  for (std::size_t i = 0; i < scene.model.atlas.texels.size(); i += 2) scene.model.atlas.texels[i].a = -0.1f;
  const auto weights = randomWeights(scene.camera, 2);
  const ModelGradient cpu = gradientOf(*makeCpuDifferentiableRenderer(), scene.model, scene.camera, {}, weights);
  const ModelGradient cuda = gradientCuda(scene.model, scene.camera, {}, weights);
  for (std::size_t i = 0; i < scene.model.size(); ++i) {
    INFO(i);
    // CUDA drops what its exact outline keeps off every tile, too.
    if (cuda.screen_radius[i] > 0) CHECK(cuda.screen_radius[i] == Approx(cpu.screen_radius[i]).epsilon(1e-3));
    if (glm::length(cpu.v_mean[i]) > 0) CHECK(cuda.screen_radius[i] > 0);
  }
  for (std::size_t i = 0; i < cuda.v_texels.size(); i += 2) REQUIRE(cuda.v_texels[i].a == 0.0f);
}

TEST_CASE("CUDA draws nothing, and has no gradient, where no Gaussian is", "[checked]") {
  const TestScene scene = makeScene(SceneKind::ordinary, 1, 5);
  const auto renderer = makeCudaDifferentiableRenderer();
  ModelGradient gradient;
  CHECK_THROWS_AS(renderer->backward({}, gradient), Error);
  RenderSettings settings;
  settings.background = {0.25f, 0.5f, 0.75f};
  const auto& picture = renderer->forward(GaussianModel{}, scene.camera, settings);
  for (const glm::vec3& pixel : picture) REQUIRE(pixel == settings.background);
  renderer->backward(std::vector<glm::vec3>(picture.size(), glm::vec3(1.0f)), gradient);
  CHECK(gradient.v_mean.empty());
  CHECK_THROWS_AS(renderer->backward(std::vector<glm::vec3>(7), gradient), Error);
}

#ifndef TG_CUDA_ON_DEVICE
TEST_CASE("the host's stand-in finds threads that miss a barrier") {
  const auto half = [](const void*) {
    if (threadIdx.x < 128) __syncthreads();
  };
  CHECK_THROWS_AS(cuda::runBlocks("half", 1, half, nullptr), std::logic_error);
}
#endif
