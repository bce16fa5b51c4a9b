// SPDX-License-Identifier: Apache-2.0
// The CPU renderer against the float64 reference with every setting that a viewer changes and every output beyond the
// blended ones.
#include <cmath>

#include "core/bundle.h"
#include "render/reference/reference.h"
#include "render/renderer.h"
#include "support/catch.h"
#include "support/compare.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

constexpr OutputSet kEverything = kBlendedOutputs | OutputSet{Output::depthMedian, Output::overdraw, Output::ellipsoids,
                                                              Output::centers, Output::texelDensity};

Frame renderCpu(const GaussianModel& model, const Camera& camera, const RenderSettings& settings) {
  const auto renderer = makeCpuRenderer();
  renderer->setModel(model);
  return renderer->render(camera, settings);
}

double differ(double a, double b) { return std::abs(a - b) / std::max(1.0, std::abs(b)); }
double differ(glm::vec3 a, glm::dvec3 b) { return std::max({differ(a.x, b.x), differ(a.y, b.y), differ(a.z, b.z)}); }

// The share of pixels that differ by more than float rounding: a threshold or a silhouette fell differently.
template <typename A, typename B>
double strays(const std::vector<A>& pixels, const std::vector<B>& reference, double allowed) {
  REQUIRE(pixels.size() == reference.size());
  double count = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) count += !(differ(pixels[i], reference[i]) <= allowed);
  return count / static_cast<double>(pixels.size());
}

void checkExtras(const Frame& frame, const FrameT<double>& reference) {
  CHECK(strays(frame.depth_median, reference.depth_median, 1e-3) <= 0.003);
  CHECK(strays(frame.overdraw, reference.overdraw, 0.0) <= 0.005);
  CHECK(strays(frame.ellipsoids, reference.ellipsoids, 5e-3) <= 0.005);
  CHECK(strays(frame.centers, reference.centers, 1e-4) <= 0.005);
  CHECK(strays(frame.texel_density, reference.texel_density, 2e-3) <= 0.005);
}

void checkAgainstReference(SceneKind kind, const TestScene& scene, const RenderSettings& settings) {
  const Tolerance allowed = tolerance(kind, *settings.intersection);
  const auto reference = renderReference(ReferenceModel(scene.model), scene.camera, settings);
  const Frame frame = renderCpu(scene.model, scene.camera, settings);
  const FrameDifference difference = compareFrames(frame, reference, allowed);
  INFO(name(kind) << ", " << name(*settings.intersection) << "\n" << report(difference));
  CHECK(violations(difference, allowed) == "");
  if (settings.outputs.has(Output::overdraw)) checkExtras(frame, reference);
}

constexpr std::array kModels = {IntersectionModel::plane, IntersectionModel::maxResponse};

RenderSettings everything(IntersectionModel intersection) {
  RenderSettings settings;
  settings.intersection = intersection;
  settings.background = {0.3f, 0.1f, 0.8f};
  settings.outputs = kEverything;
  return settings;
}

}  // namespace

TEST_CASE("every output beyond the blended ones equals the reference's") {
  for (const SceneKind kind : kSceneKinds) {
    for (const auto intersection : kModels) checkAgainstReference(kind, makeScene(kind, 11), everything(intersection));
  }
}

TEST_CASE("scales, SH degree, near plane and crop box equal the reference's") {
  for (const auto intersection : kModels) {
    RenderSettings settings = everything(intersection);
    settings.opacity_scale = 1.7f;
    settings.splat_scale = 0.4f;
    settings.max_sh_degree = 2;
    checkAgainstReference(SceneKind::mixed, makeScene(SceneKind::mixed, 12), settings);
    settings = everything(intersection);
    settings.opacity_scale = 0.25f;
    settings.max_sh_degree = 0;
    settings.near = 2.5f;
    settings.crop = CropBox{{-1.0f, -0.75f, -10.0f}, {1.0f, 10.0f, 10.0f}};
    checkAgainstReference(SceneKind::mixed, makeScene(SceneKind::mixed, 13), settings);
    settings = everything(intersection);
    settings.near = 0.05f;
    checkAgainstReference(SceneKind::nearPlane, makeScene(SceneKind::nearPlane, 14), settings);
  }
}

TEST_CASE("screen antialiasing and the footprint filter equal the reference's") {
  for (const SceneKind kind : {SceneKind::mixed, SceneKind::flat, SceneKind::needles, SceneKind::edgeOn}) {
    for (const auto intersection : kModels) {
      TestScene scene = makeScene(kind, 15);
      RenderSettings settings = everything(intersection);
      settings.splat_scale = 0.2f;  // so that many are about a pixel wide
      settings.antialiasing = Antialiasing::screen;
      checkAgainstReference(kind, scene, settings);
      settings.antialiasing = Antialiasing::off;
      settings.texture_filter = TextureFilter::footprint;
      checkAgainstReference(kind, scene, settings);
    }
  }
}

TEST_CASE("a picture alone is that of a whole frame") {
  const TestScene scene = makeScene(SceneKind::mixed, 16, 200, 70, 40);
  for (const auto order : {SplatOrder::global, SplatOrder::perPixel}) {
    RenderSettings settings;
    settings.order = order;
    settings.background = {0.2f, 0.4f, 0.1f};
    const Frame all = renderCpu(scene.model, scene.camera, settings);
    settings.outputs = {Output::final, Output::alpha};
    const Frame picture = renderCpu(scene.model, scene.camera, settings);
    CHECK(picture.base.empty());
    CHECK(picture.depth.empty());
    for (std::size_t i = 0; i < all.base.size(); ++i) {
      REQUIRE(glm::all(glm::lessThan(glm::abs(picture.color(i) - all.color(i)), glm::vec3(2e-6f))));
      REQUIRE(std::abs(picture.alpha[i] - all.alpha[i]) < 1e-6f);
    }
  }
}

// Exact for hits within kOrderDepth places of their place in the coarse order.
TEST_CASE("per-pixel order equals the reference's full sort") {
  for (const SceneKind kind : kSceneKinds) {
    for (const auto intersection : kModels) {
      RenderSettings settings;
      settings.intersection = intersection;
      settings.order = SplatOrder::perPixel;
      const TestScene scene = makeScene(kind, 17);
      const auto reference = renderReference(ReferenceModel(scene.model), scene.camera, settings);
      const Frame frame = renderCpu(scene.model, scene.camera, settings);
      settings.order = SplatOrder::global;
      const Frame global = renderCpu(scene.model, scene.camera, settings);
      double squared = 0, squared_global = 0;
      std::size_t far = 0;
      for (std::size_t i = 0; i < reference.base.size(); ++i) {
        const glm::dvec3 d = glm::dvec3(frame.color(i)) - reference.color(i);
        const glm::dvec3 g = glm::dvec3(global.color(i)) - reference.color(i);
        squared += glm::dot(d, d);
        squared_global += glm::dot(g, g);
        far += glm::length(d) > 1e-3;
      }
      INFO(name(kind) << ", " << name(intersection) << ": squared error " << squared << ", of the global order "
                      << squared_global << ", pixels off by more than 1e-3: " << far << " of "
                      << reference.base.size());
      CHECK(squared <= 1e-3 * squared_global + 1e-4);
    }
  }
}

TEST_CASE("all settings on a trained model equal the reference's") {
  const Bundle bundle = readBundle("docs/sample.tgz");
  Camera camera = resized(bundle.cameras.front(), bundle.cameras.front().width / 2, bundle.cameras.front().height / 2);
  RenderSettings settings;
  settings.outputs = kEverything;
  settings.texture_filter = TextureFilter::footprint;
  settings.antialiasing = Antialiasing::screen;
  const ReferenceModel exact(bundle.model);
  const Frame frame = renderCpu(bundle.model, camera, settings);
  const auto reference = renderReference(exact, camera, settings);
  CHECK(strays(frame.base, reference.base, 1e-3) <= 0.002);
  CHECK(strays(frame.texture, reference.texture, 1e-3) <= 0.002);
  checkExtras(frame, reference);
  settings.outputs = {Output::final};
  settings.order = SplatOrder::perPixel;
  CHECK(strays(renderCpu(bundle.model, camera, settings).picture, renderReference(exact, camera, settings).picture,
               2e-3) <= 0.01);
}
