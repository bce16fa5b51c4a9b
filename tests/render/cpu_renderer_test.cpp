// SPDX-License-Identifier: Apache-2.0
// The CPU renderer against the float64 reference, and against itself over threads and SIMD targets.
#include <hwy/targets.h>

#include <cstring>

#include "core/system/error.h"
#include "core/system/parallel.h"
#include "render/reference/reference.h"
#include "render/renderer.h"
#include "support/catch.h"
#include "support/compare.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

Frame renderCpu(const TestScene& scene, const RenderSettings& settings) {
  const auto renderer = makeCpuRenderer();
  renderer->setModel(scene.model);
  return renderer->render(scene.camera, settings);
}

void checkAgainstReference(const TestScene& scene, const RenderSettings& settings, const Tolerance& allowed) {
  const auto reference = renderReference(ReferenceModel(scene.model), scene.camera, settings);
  const FrameDifference difference = compareFrames(renderCpu(scene, settings), reference, allowed);
  INFO(report(difference));
  CHECK(violations(difference, allowed) == "");
}

void checkAgainstReference(SceneKind kind, const TestScene& scene, const RenderSettings& settings) {
  INFO(name(kind) << ", " << name(*settings.intersection) << ", textures " << name(settings.textures));
  checkAgainstReference(scene, settings, tolerance(kind, *settings.intersection));
}

template <typename T>
bool sameBytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}
bool sameBytes(const Frame& a, const Frame& b) {
  return sameBytes(a.base, b.base) && sameBytes(a.texture, b.texture) && sameBytes(a.alpha, b.alpha) &&
         sameBytes(a.depth, b.depth) && sameBytes(a.normal, b.normal) && sameBytes(a.count, b.count);
}

constexpr std::array kModels = {IntersectionModel::plane, IntersectionModel::maxResponse};

}  // namespace

TEST_CASE("every output equals the reference's on every kind of scene, in both models") {
  for (const SceneKind kind : kSceneKinds) {
    for (const auto intersection : kModels) {
      RenderSettings settings;
      settings.intersection = intersection;
      settings.background = {0.3f, 0.1f, 0.8f};
      checkAgainstReference(kind, makeScene(kind, 1), settings);
    }
  }
}

TEST_CASE("where rays lie in the plane of a Gaussian every output equals the reference's") {
  for (const int side : {0, 1, 4, 8}) {
    INFO(side);
    checkAgainstReference(raysInPlaneScene(side), {}, raysInPlaneTolerance());
  }
}

TEST_CASE("every texture mode equals the reference's") {
  const TestScene scene = makeScene(SceneKind::mixed, 2);
  for (const auto mode : {TextureMode::none, TextureMode::alpha, TextureMode::rgb, TextureMode::rgba}) {
    for (const auto intersection : kModels) {
      RenderSettings settings;
      settings.textures = mode;
      settings.intersection = intersection;
      checkAgainstReference(SceneKind::mixed, scene, settings);
    }
  }
}

TEST_CASE("images of one pixel, of one row, and wider than several tiles equal the reference's") {
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(130, 1), std::pair(1, 50), std::pair(101, 37)}) {
    RenderSettings settings;
    settings.intersection = IntersectionModel::maxResponse;
    checkAgainstReference(SceneKind::ordinary, makeScene(SceneKind::ordinary, 3, 100, width, height), settings);
  }
}

TEST_CASE("a frame has the same bytes for any number of threads") {
  const TestScene scene = makeScene(SceneKind::mixed, 4, 300, 100, 80);
  setThreadCount(1);
  const Frame one = renderCpu(scene, {});
  for (const int threads : {2, 3, 8}) {
    setThreadCount(threads);
    CHECK(sameBytes(renderCpu(scene, {}), one));
  }
  setThreadCount(0);
}

TEST_CASE("every SIMD target of this machine agrees with the reference") {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    INFO(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    for (const SceneKind kind : {SceneKind::ordinary, SceneKind::oddTextures, SceneKind::nearPlane}) {
      RenderSettings settings;
      settings.intersection = IntersectionModel::maxResponse;
      checkAgainstReference(kind, makeScene(kind, 5), settings);
    }
    hwy::SetSupportedTargetsForTest(0);
  }
}

TEST_CASE("scales and means beyond any picture draw nothing and break nothing") {
  TestScene scene = makeScene(SceneKind::ordinary, 6, 40);
  const float inf_like[] = {-1e30f, -200.0f, 88.0f, 200.0f, 1e30f};
  for (std::size_t i = 0; i < scene.model.size(); ++i) {
    if (i % 4 == 0) scene.model.log_scale[i][static_cast<int>(i % 3)] = inf_like[i / 4 % 5];
    if (i % 4 == 1) scene.model.mean[i] *= i % 8 == 1 ? 1e30f : 1e-30f;
    if (i % 4 == 2) scene.model.opacity_logit[i] = i % 8 == 2 ? 1e30f : -1e30f;
    if (i % 4 == 3) scene.model.rotation[i] *= i % 8 == 3 ? 1e-18f : 1e18f;
  }
  const Frame frame = renderCpu(scene, {});
  for (std::size_t pixel = 0; pixel < frame.alpha.size(); ++pixel) {
    const glm::vec3 color = frame.color(pixel);
    REQUIRE(std::isfinite(color.x + color.y + color.z + frame.alpha[pixel] + frame.depth[pixel]));
  }
}

TEST_CASE("rendering without a model or with an empty camera is a usage error") {
  const auto renderer = makeCpuRenderer();
  CHECK_THROWS_AS(renderer->render(makeScene(SceneKind::ordinary, 1, 1).camera, {}), Error);
  renderer->setModel(makeScene(SceneKind::ordinary, 1, 1).model);
  CHECK_THROWS_AS(renderer->render(Camera{}, {}), Error);
}

TEST_CASE("an empty model shows the background") {
  const auto renderer = makeCpuRenderer();
  renderer->setModel(GaussianModel{});
  RenderSettings settings;
  settings.background = {0.25f, 0.5f, 1.0f};
  const Frame frame = renderer->render(makeScene(SceneKind::ordinary, 1, 1).camera, settings);
  for (std::size_t pixel = 0; pixel < frame.alpha.size(); ++pixel) {
    REQUIRE(frame.color(pixel) == settings.background);
    REQUIRE(frame.alpha[pixel] == 0.0f);
  }
}
