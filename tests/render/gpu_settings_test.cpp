// SPDX-License-Identifier: Apache-2.0
// What a viewer may change and ask for: a GPU renderer against the float64 reference.
#include <algorithm>
#include <cmath>
#include <glm/gtc/packing.hpp>

#include "gpu_device.h"
#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "support/setting_values.h"

using namespace tg;
using namespace tg::test;

namespace {

TestScene halfTexels(TestScene scene) {
  for (glm::vec4& texel : scene.model.atlas.texels) texel = glm::unpackHalf4x16(glm::packHalf4x16(texel));
  return scene;
}

Frame renderScene(const TestScene& scene, const RenderSettings& settings) {
  GpuRenderer& renderer = gpuRenderer();
  renderer.setModel(scene.model);
  return renderer.render(scene.camera, settings);
}

FrameT<double> renderTruth(const TestScene& scene, const RenderSettings& settings) {
  return renderReference(ReferenceModel(scene.model), scene.camera, settings);
}

void checkBlended(const TestScene& scene, const RenderSettings& settings, SceneKind kind) {
  Tolerance limits = tolerance(kind, settings.intersection.value_or(scene.model.intersection));
  limits.outlier_share = std::max(limits.outlier_share, 7e-3);
  const FrameDifference difference = compareFrames(renderScene(scene, settings), renderTruth(scene, settings), limits);
  INFO(report(difference));
  CHECK(violations(difference, limits) == "");
  CHECK(validationMessages() == "");
}

double distance(float a, double b) { return std::abs(a - b); }
double distance(glm::vec3 a, glm::dvec3 b) { return glm::length(glm::dvec3(a) - b); }
double magnitude(double b) { return std::abs(b); }
double magnitude(glm::dvec3 b) { return glm::length(b); }

// The share of the pixels that lie farther than 1e-3 of the larger of 1 and their size from the truth.
template <typename T, typename U>
double wrongShare(const std::vector<T>& pixels, const std::vector<U>& truth) {
  REQUIRE(pixels.size() == truth.size());
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    wrong += !(distance(pixels[i], truth[i]) <= 1e-3 * std::max(1.0, magnitude(truth[i])));
  }
  return static_cast<double>(wrong) / static_cast<double>(pixels.size());
}

// The share of the pixels that are not 0 or background.
template <typename T>
double shown(const std::vector<T>& pixels, T nothing) {
  const auto empty = std::count(pixels.begin(), pixels.end(), nothing);
  return 1.0 - static_cast<double>(empty) / static_cast<double>(pixels.size());
}

// As a frame, and as the picture of the device where it makes one.
std::vector<Image> drawnByGpu(const TestScene& scene, RenderSettings settings, Output output) {
  GpuRenderer& renderer = gpuRenderer();
  renderer.setModel(scene.model);
  settings.outputs = {output};
  std::vector<Image> pictures = {visualize(renderer.render(scene.camera, settings), output, settings)};
  if (!mapsOnHost(output, settings)) {
    REQUIRE(renderer.draw({scene.camera, settings, output}));
    pictures.push_back(renderer.picture());
  }
  return pictures;
}

}  // namespace

TEST_CASE("scales, SH degree, near plane and crop box agree with the reference") {
  const SceneKind kind = GENERATE(SceneKind::ordinary, SceneKind::nearPlane);
  const TestScene scene = halfTexels(makeScene(kind, 21));
  RenderSettings settings;
  SECTION("opacity") { settings.opacity_scale = GENERATE(0.4f, 3.0f); }
  SECTION("size") { settings.splat_scale = GENERATE(0.5f, 1.7f); }
  SECTION("SH degree") { settings.max_sh_degree = GENERATE(0, 1, 2); }
  SECTION("near") { settings.near = GENERATE(0.05f, 3.0f); }
  SECTION("crop") { settings.crop = CropBox{scene.model.mean[0] - 1.5f, scene.model.mean[0] + 1.5f}; }
  REQUIRE(!(settings == RenderSettings{}));
  checkBlended(scene, settings, kind);
}

TEST_CASE("screen antialiasing agrees with the reference for both intersection models") {
  const SceneKind kind = GENERATE(SceneKind::ordinary, SceneKind::needles, SceneKind::flat);
  RenderSettings settings;
  settings.intersection = GENERATE(IntersectionModel::plane, IntersectionModel::maxResponse);
  settings.antialiasing = Antialiasing::screen;
  checkBlended(halfTexels(makeScene(kind, 22)), settings, kind);
}

TEST_CASE("the footprint filter agrees with the reference from one texel a pixel to the mean") {
  TestScene scene = halfTexels(makeScene(SceneKind::oddTextures, 23));
  RenderSettings settings;
  settings.texture_filter = TextureFilter::footprint;
  settings.intersection = GENERATE(IntersectionModel::plane, IntersectionModel::maxResponse);
  settings.splat_scale = GENERATE(0.05f, 0.3f, 1.0f);
  checkBlended(scene, settings, SceneKind::oddTextures);
}

TEST_CASE("beyond textures every treatment agrees with the reference", "[slow]") {
  const SceneKind kind = GENERATE(SceneKind::edgeOn, SceneKind::flat, SceneKind::oddTextures, SceneKind::mixed);
  const TestScene scene = halfTexels(makeScene(kind, 28));
  RenderSettings settings;
  settings.intersection = GENERATE(IntersectionModel::plane, IntersectionModel::maxResponse);
  settings.outside = GENERATE(TextureOutside::base, TextureOutside::clip, TextureOutside::edge);
  settings.texture_filter = GENERATE(TextureFilter::bilinear, TextureFilter::footprint);
  INFO(name(kind) << ", " << name(*settings.intersection) << ", " << name(*settings.outside));
  checkBlended(scene, settings, kind);
  const FrameT<double> truth = renderTruth(scene, settings);
  settings.outputs = {Output::final};
  const Frame alone = renderScene(scene, settings);
  std::vector<glm::dvec3> colors(truth.base.size());
  for (std::size_t i = 0; i < colors.size(); ++i) colors[i] = truth.color(i);
  CHECK(wrongShare(alone.picture, colors) <= 2e-2);
}

TEST_CASE("the treatment beyond textures is the model's own unless a setting says otherwise") {
  TestScene scene = halfTexels(makeScene(SceneKind::flat, 29));
  RenderSettings settings;
  const Frame base = renderScene(scene, settings);
  settings.outside = TextureOutside::clip;
  const Frame clipped = renderScene(scene, settings);
  const bool differ = base.count != clipped.count;
  CHECK(differ);
  scene.model.outside = TextureOutside::clip;
  const bool own = renderScene(scene, {}).count == clipped.count;
  CHECK(own);
  settings.outside = TextureOutside::base;
  const bool overridden = renderScene(scene, settings).count == base.count;
  CHECK(overridden);
}

TEST_CASE("median depth, overdraw and texel density agree with the reference") {
  const SceneKind kind = GENERATE(SceneKind::ordinary, SceneKind::mixed, SceneKind::stacked);
  TestScene scene = halfTexels(makeScene(kind, 24));
  // So that rays end early.
  if (kind == SceneKind::stacked) {
    for (glm::vec4& texel : scene.model.atlas.texels) texel.a = 1.0f;
  }
  RenderSettings settings;
  settings.outputs = {Output::depthMedian, Output::overdraw, Output::texelDensity, Output::count};
  const Frame frame = renderScene(scene, settings);
  const FrameT<double> truth = renderTruth(scene, settings);
  INFO(name(kind));
  CHECK(wrongShare(frame.depth_median, truth.depth_median) <= 5e-3);
  CHECK(wrongShare(frame.overdraw, truth.overdraw) <= 5e-3);
  CHECK(wrongShare(frame.texel_density, truth.texel_density) <= 5e-3);
  CHECK(shown(frame.depth_median, 0.0f) > 0.05);
  CHECK(shown(frame.texel_density, 0.0f) > 0.3);
  if (kind == SceneKind::stacked) {
    const bool more = frame.overdraw != frame.count;
    CHECK(more);
  }
  settings.outputs = kBlendedOutputs;
  const bool same_count = renderScene(scene, settings).count == frame.count;
  CHECK(same_count);
  CHECK(validationMessages() == "");
}

TEST_CASE("ellipsoids and centres agree with the reference") {
  const SceneKind kind = GENERATE(SceneKind::ordinary, SceneKind::flat, SceneKind::aroundCamera);
  const TestScene scene = makeScene(kind, 25, 200, 90, 70);
  RenderSettings settings;
  settings.background = {0.1f, 0.2f, 0.3f};
  settings.outputs = {Output::ellipsoids, Output::centers};
  settings.splat_scale = GENERATE(1.0f, 0.5f);
  settings.intersection = GENERATE(IntersectionModel::plane, IntersectionModel::maxResponse);
  const Frame frame = renderScene(scene, settings);
  const FrameT<double> truth = renderTruth(scene, settings);
  INFO(name(kind));
  CHECK(wrongShare(frame.ellipsoids, truth.ellipsoids) <= 1e-2);
  CHECK(wrongShare(frame.centers, truth.centers) <= 1e-2);
  CHECK(shown(frame.ellipsoids, settings.background) > 0.05);
  CHECK(shown(frame.centers, settings.background) > 0.02);
  CHECK(validationMessages() == "");
}

TEST_CASE("ellipsoids have their light however thin they are") {
  const float thinness = GENERATE(1e-4f, 1e-7f, 1e-9f);
  TestScene scene = makeScene(SceneKind::flat, 16);
  for (glm::vec3& log_scale : scene.model.log_scale) {
    *std::min_element(&log_scale.x, &log_scale.x + 3) =
        std::max({log_scale.x, log_scale.y, log_scale.z}) + std::log(thinness);
  }
  RenderSettings settings;
  settings.outputs = {Output::ellipsoids};
  const Frame frame = renderScene(scene, settings);
  const FrameT<double> truth = renderTruth(scene, settings);
  INFO(thinness);
  CHECK(wrongShare(frame.ellipsoids, truth.ellipsoids) <= 1e-2);
  CHECK(shown(frame.ellipsoids, settings.background) > 0.05);
}

TEST_CASE("hits of one depth keep the order of their Gaussians, in either order") {
  TestScene scene = thinDiscScene(0.1f, false);
  GaussianModel& model = scene.model;
  const int count = GENERATE(12, 24);  // kept open at a pixel's front all, and more than are
  const bool overtakes = count == 12;  // the last one, sorted last and tilted: before the others on one side
  for (int i = 1; i < count; ++i) {
    model.mean.push_back(model.mean[0] + glm::vec3(0, 0, overtakes && i + 1 == count ? 0.1f : 0.0f));
    model.rotation.push_back(model.rotation[0]);
    model.log_scale.push_back(model.log_scale[0]);
    model.opacity_logit.push_back(-1.0f);
  }
  if (overtakes) model.rotation.back() = {0.9f, 0.3f, 0.0f, 0.0f};
  model.opacity_logit[0] = -1.0f;
  model.sh.clear();
  for (int i = 0; i < count; ++i) model.sh.push_back(glm::vec3(i % 4 == 0, i % 4 == 1, i % 4 == 2));
  RenderSettings settings;
  settings.order = GENERATE(SplatOrder::global, SplatOrder::perPixel);
  const FrameT<double> truth = renderTruth(scene, settings);
  settings.outputs = {Output::final};
  const Frame frame = renderScene(scene, settings);
  std::vector<glm::dvec3> colors(truth.base.size());
  for (std::size_t i = 0; i < colors.size(); ++i) colors[i] = truth.color(i);
  INFO(name(settings.order) << ", " << count);
  CHECK(wrongShare(frame.picture, colors) <= (overtakes ? 1e-2 : 0.0));
}

TEST_CASE("a frame holds the picture alone when nothing else is asked for, and it is the same picture") {
  const TestScene scene = halfTexels(makeScene(SceneKind::mixed, 26));
  RenderSettings settings;
  settings.background = {0.3f, 0.6f, 0.9f};
  const Frame all = renderScene(scene, settings);
  settings.outputs = {Output::final};
  const Frame alone = renderScene(scene, settings);
  CHECK(alone.base.empty());
  CHECK(alone.depth.empty());
  REQUIRE(alone.picture.size() == all.base.size());
  float largest = 0.0f;
  for (std::size_t i = 0; i < all.base.size(); ++i) {
    largest = std::max(largest, glm::length(alone.color(i) - all.color(i)));
  }
  CHECK(largest < 1e-5f);
  CHECK(validationMessages() == "");
}

TEST_CASE("the per-pixel order is the reference's wherever no more than sixteen hits change places") {
  const SceneKind kind = GENERATE(SceneKind::ordinary, SceneKind::flat, SceneKind::stacked, SceneKind::needles);
  const TestScene scene = halfTexels(makeScene(kind, 27, 120));
  RenderSettings settings;
  settings.order = SplatOrder::perPixel;
  const Frame frame = renderScene(scene, settings);
  const FrameT<double> truth = renderTruth(scene, settings);
  INFO(name(kind));
  const auto colors = [](const auto& f) {
    auto result = f.base;
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = f.color(i);
    return result;
  };
  const double wrong = wrongShare(colors(frame), colors(truth));
  RenderSettings global;
  const double wrong_globally = wrongShare(colors(renderScene(scene, global)), colors(truth));
  INFO("wrong " << wrong << ", in the global order " << wrong_globally);
  CHECK(wrong <= 1e-3);
  CHECK(wrong_globally >= 1e-2);
  CHECK(validationMessages() == "");
}

TEST_CASE("two opaque splats end a ray where they end the reference's") {
  const TestScene scene = opaqueDiscsScene();
  constexpr std::size_t kPixel = 16 * 32 + 16;
  RenderSettings settings;
  settings.intersection = GENERATE(IntersectionModel::plane, IntersectionModel::maxResponse);
  settings.order = GENERATE(SplatOrder::global, SplatOrder::perPixel);
  settings.background = glm::vec3(1.0f);
  const Frame frame = renderScene(scene, settings);
  const FrameT<double> truth = renderTruth(scene, settings);
  INFO(name(*settings.intersection) << ", " << name(settings.order));
  REQUIRE(truth.count[kPixel] == 1.0);
  CHECK(frame.count[kPixel] == 1.0f);
  CHECK(distance(frame.color(kPixel), truth.color(kPixel)) < 1e-5);
  CHECK(validationMessages() == "");
}

TEST_CASE("every setting makes of a picture what it makes of the reference's") {
  CHECK(ignoredSettings(drawnByGpu) == "");
  CHECK(validationMessages() == "");
}

TEST_CASE("every output shows something and what the reference's shows") {
  CHECK(undrawnOutputs(drawnByGpu) == "");
  CHECK(validationMessages() == "");
}
