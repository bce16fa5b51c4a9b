// SPDX-License-Identifier: Apache-2.0
// The CUDA kernels against the float64 reference and the CPU's; in every order of threads.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/system/error.h"
#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/cuda_orders.h"
#include "support/gradients.h"
#include "support/scenes.h"
#include "training/cuda/finish.h"
#include "training/cuda/memory.h"
#include "training/cuda/renderer.h"

using namespace tg;
using namespace tg::test;

namespace {

ModelGradient gradientCuda(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                           const std::vector<glm::dvec3>& weights, const GradientOptions& options = {}) {
  return gradientOf(*makeCudaDifferentiableRenderer(), model, camera, settings, weights, options);
}

// CUDA's, as near to the CPU's as two orders of float sums are.
std::vector<glm::vec3> checkPicture(const TestScene& scene, const RenderSettings& settings) {
  const auto cpu = makeCpuDifferentiableRenderer();
  const auto cuda = makeCudaDifferentiableRenderer();
  const auto& expected = cpu->forward(scene.model, scene.camera, settings);
  const auto& found = cuda->forward(scene.model, scene.camera, settings);
  REQUIRE(found.size() == expected.size());
  std::size_t flipped = 0;
  for (std::size_t pixel = 0; pixel < found.size(); ++pixel) {
    const float difference = glm::length(found[pixel] - expected[pixel]);
    REQUIRE(difference < 2e-2f);
    flipped += difference > 2e-4f;
  }
  CHECK(flipped <= found.size() / 1000);
  return found;
}

// |found - expected| / |expected| over all numbers.
template <typename Vector>
double relativeDifference(const std::vector<Vector>& found, const std::vector<Vector>& expected) {
  const auto a = numbers(found), b = numbers(expected);
  REQUIRE(a.size() == b.size());
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference += (double{a[i]} - b[i]) * (double{a[i]} - b[i]);
    size += double{b[i]} * b[i];
  }
  return std::sqrt(difference / size);
}

// Splats that cover more tiles than cuda::kRun beside small ones; faint, so that light reaches most of them.
TestScene sceneOfLargeSplats(unsigned seed) {
  TestScene scene = makeScene(SceneKind::mixed, seed, 24, 176, 160);
  for (std::size_t i = 0; i < scene.model.size(); ++i) {
    if (i % 3 != 0) continue;
    scene.model.log_scale[i] += 3.0f;
    scene.model.opacity_logit[i] = -2.0f;
  }
  return scene;
}

}  // namespace

TEST_CASE("CUDA adds up a splat's pairs in runs, and leaves alone those of small ones", "[checked]") {
  const std::vector<std::uint32_t> counts = {3, 64, 0, 65, 128, 1, 1000, 129, 70};
  const std::vector<std::uint32_t> order = {6, 2, 0, 3, 5, 8, 1, 7, 4};  // of depth
  constexpr unsigned stride = cuda::pairSums(true, true);
  constexpr std::size_t room = 2000;
  std::vector<std::uint32_t> begins(counts.size()), gaussians;
  for (const std::uint32_t i : order) {
    begins[i] = static_cast<std::uint32_t>(gaussians.size());
    gaussians.insert(gaussians.end(), counts[i], i);
  }
  const std::vector<cuda::PairCount> pairs = {gaussians.size()};
  test::Random random(3);
  std::vector<float> values(room * stride);
  std::vector<std::uint8_t> shows(room);
  for (float& value : values) value = static_cast<float>(random.normal());
  for (std::size_t pair = 0; pair < pairs[0]; ++pair) shows[pair] = gaussians[pair] != 8 && random.uniform() < 0.6;

  cuda::Buffer<std::uint32_t> gaussian, tile_counts, pair_begin;
  cuda::Buffer<cuda::PairCount> pair_count;
  cuda::Buffer<float> sums;
  cuda::Buffer<std::uint8_t> shown;
  gaussian.upload(gaussians);
  tile_counts.upload(counts);
  pair_begin.upload(begins);
  pair_count.upload(pairs);
  const auto run = [&](std::size_t with_room, std::vector<float>& to, std::vector<std::uint8_t>& to_shows) {
    sums.upload(values);
    shown.upload(shows);
    cuda::addRuns({gaussian.data(), tile_counts.data(), pair_begin.data(), pair_count.data(), with_room, stride,
                   sums.data(), shown.data()});
    sums.downloadAll(to);
    shown.downloadAll(to_shows);
  };
  std::vector<float> found, again;
  std::vector<std::uint8_t> found_shows, again_shows;
  run(room, found, found_shows);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const bool large = counts[i] > cuda::kRun;
    for (std::uint32_t place = 0; place < counts[i]; ++place) {
      const std::size_t pair = begins[i] + place;
      const bool first = large && place % cuda::kRun == 0;
      bool any = false;
      double expected[stride] = {};
      const std::uint32_t end = first ? std::min(place + cuda::kRun, counts[i]) : place + 1;
      for (std::size_t other = pair; other < begins[i] + end; ++other) {
        if (shows[other] == 0) continue;
        any = true;
        for (unsigned k = 0; k < stride; ++k) expected[k] += double{values[other * stride + k]};
      }
      INFO("Gaussian " << i << ", pair " << place);
      REQUIRE((found_shows[pair] != 0) == any);
      if (!any) continue;
      for (unsigned k = 0; k < stride; ++k) {
        REQUIRE(found[pair * stride + k] == Approx(expected[k]).margin(1e-4));
      }
    }
  }
  inOtherOrders([&] {
    run(room, again, again_shows);
    CHECK(again == found);
    CHECK(again_shows == found_shows);
  });
  run(pairs[0] - 1, again, again_shows);  // no room
  CHECK(again == values);
  CHECK(again_shows == shows);
}

TEST_CASE("CUDA gradients of splats that fill the picture are the CPU's, in every order of threads") {
  for (const unsigned seed : {1u, 2u}) {
    const TestScene scene = sceneOfLargeSplats(seed);
    const auto weights = randomWeights(scene.camera, 2);
    const ModelGradient cpu = gradientOf(*makeCpuDifferentiableRenderer(), scene.model, scene.camera, {}, weights);
    const ModelGradient cuda = gradientCuda(scene.model, scene.camera, {}, weights);
    CHECK(*std::max_element(cuda.screen_radius.begin(), cuda.screen_radius.end()) > 176);
    forEachParameter(
        [](const Field& field, const auto& a, const auto& b) {
          INFO(field.name);
          CHECK(relativeDifference(a, b) < 1e-4);
        },
        cuda, cpu);
    CHECK(relativeDifference(cuda.screen_gradient, cpu.screen_gradient) < 1e-4);
    CHECK(relativeDifference(cuda.screen_gradient_abs, cpu.screen_gradient_abs) < 1e-4);
    if (seed == 1) {
      inOtherOrders([&] { CHECK(sameBytes(gradientCuda(scene.model, scene.camera, {}, weights), cuda)); });
    }
  }
}

TEST_CASE("a view that shows no pixel of a splat, though its box has some, counts with CUDA as on the CPU") {
  TestScene scene = makeScene(SceneKind::ordinary, 8, 600, 60, 40);
  for (glm::vec3& log_scale : scene.model.log_scale) log_scale -= glm::vec3(2.0f, 3.0f, 4.0f);
  scene.model.texture_mode = TextureMode::none;
  scene.model.atlas = {};
  const auto weights = randomWeights(scene.camera, 2);
  const auto renderer = makeCpuDifferentiableRenderer();
  const ModelGradient cpu = gradientOf(*renderer, scene.model, scene.camera, {}, weights);
  const ModelGradient cuda = gradientCuda(scene.model, scene.camera, {}, weights);
  std::size_t seen = 0, without_pixel = 0, apart = 0;
  for (std::size_t i = 0; i < scene.model.size(); ++i) {
    seen += cpu.screen_radius[i] > 0;
    without_pixel += cpu.screen_radius[i] > 0 && cpu.screen_gradient[i] == 0;
    apart += !(std::abs(cuda.screen_radius[i] - cpu.screen_radius[i]) <= 1e-3f * cpu.screen_radius[i]);
  }
  CAPTURE(seen, without_pixel);
  CHECK(seen > 100);
  CHECK(without_pixel > 20);
  CHECK(apart <= 1);
}

TEST_CASE("CUDA pictures are the CPU's on every kind of scene, in both models") {
  for (const SceneKind kind : kSceneKinds) {
    for (const auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
      INFO(name(kind) << ", " << name(intersection));
      const TestScene scene = makeScene(kind, 5);
      RenderSettings settings;
      settings.intersection = intersection;
      settings.background = {0.3f, 0.1f, 0.8f};
      checkPicture(scene, settings);
    }
  }
}

TEST_CASE("CUDA pictures are the CPU's in every treatment beyond textures, and one has no gradient") {
  for (const SceneKind kind : {SceneKind::edgeOn, SceneKind::flat, SceneKind::oddTextures, SceneKind::mixed}) {
    for (const auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
      TestScene scene = makeScene(kind, 6);
      RenderSettings settings;
      settings.intersection = intersection;
      const std::vector<glm::vec3> base = checkPicture(scene, settings);
      for (const auto outside : {TextureOutside::clip, TextureOutside::edge}) {
        INFO(name(kind) << ", " << name(intersection) << ", " << name(outside));
        scene.model.outside = outside;
        const std::vector<glm::vec3> picture = checkPicture(scene, settings);
        std::size_t changed = 0;
        for (std::size_t pixel = 0; pixel < picture.size(); ++pixel) {
          changed += glm::length(picture[pixel] - base[pixel]) > 5e-4f;
        }
        CHECK(changed > picture.size() / 50);
      }
    }
  }
  const auto cuda = makeCudaDifferentiableRenderer();
  TestScene scene = makeScene(SceneKind::ordinary, 6, 5);
  scene.model.outside = TextureOutside::edge;
  const std::vector<glm::vec3> picture = cuda->forward(scene.model, scene.camera, {});
  ModelGradient gradient;
  CHECK_THROWS_WITH(cuda->backward(picture, gradient), "outside edge: not supported by the backward pass");
}

TEST_CASE("CUDA gradients equal the reference's where nothing is drawn beyond textures", "[checked]") {
  checkClippedTextures([] { return makeCudaDifferentiableRenderer(); });
}

TEST_CASE("CUDA gradients equal the reference's where rays lie in the plane of a Gaussian", "[checked]") {
  checkRaysInPlane([] { return makeCudaDifferentiableRenderer(); });
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
    if (glm::length(cpu.mean[i]) > 0) CHECK(cuda.screen_radius[i] > 0);
  }
  for (std::size_t i = 0; i < cuda.texels.size(); i += 2) REQUIRE(cuda.texels[i].a == 0.0f);
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
  CHECK(gradient.mean.empty());
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
