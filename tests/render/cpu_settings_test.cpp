// SPDX-License-Identifier: Apache-2.0
// The CPU renderer against the float64 reference with every setting that a viewer changes and every output beyond the
// blended ones.
#include <hwy/targets.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/bundle/bundle.h"
#include "core/system/parallel.h"
#include "render/reference/reference.h"
#include "render/renderer.h"
#include "support/catch.h"
#include "support/compare.h"
#include "support/scenes.h"
#include "support/setting_values.h"

using namespace tg;
using namespace tg::test;

namespace {

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
  settings.outputs = kAllOutputs;
  return settings;
}

RenderSettings pictureAlone(IntersectionModel intersection) {
  RenderSettings settings;
  settings.intersection = intersection;
  settings.background = {0.3f, 0.1f, 0.8f};
  settings.outputs = {Output::final, Output::alpha};
  return settings;
}

// The band of whole frames. The picture does not say which pixels a threshold fell differently in: those beyond `tight`
// keep what flipped ones keep.
void checkPicture(SceneKind kind, const TestScene& scene, const RenderSettings& settings) {
  const Tolerance allowed = tolerance(kind, *settings.intersection);
  const Frame frame = renderCpu(scene.model, scene.camera, settings);
  RenderSettings whole = settings;
  whole.outputs = kBlendedOutputs;
  const auto reference = renderReference(ReferenceModel(scene.model), scene.camera, whole);
  double worst = 0;
  std::vector<glm::dvec3> colors(reference.base.size());
  for (std::size_t i = 0; i < colors.size(); ++i) {
    colors[i] = reference.color(i);
    worst = std::max({worst, differ(frame.picture[i], colors[i]), differ(frame.alpha[i], reference.alpha[i])});
  }
  INFO(name(kind) << ", " << name(*settings.intersection) << ", textures " << name(settings.textures));
  CHECK(worst <= allowed.flip);
  CHECK(strays(frame.picture, colors, allowed.tight) <= allowed.outlier_share);
  CHECK(strays(frame.alpha, reference.alpha, allowed.tight) <= allowed.outlier_share);
}

// By the one of its ways that an output alone takes, and by that of a whole frame.
std::vector<Image> drawnByCpu(const TestScene& scene, RenderSettings settings, Output output) {
  const auto renderer = makeCpuRenderer();
  renderer->setModel(scene.model);
  std::vector<Image> pictures;
  for (const OutputSet others : {OutputSet{}, kAllOutputs}) {
    settings.outputs = others | OutputSet{output};
    pictures.push_back(visualize(renderer->render(scene.camera, settings), output, settings));
  }
  return pictures;
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

TEST_CASE("an antialiased ellipsoid is shown where the model's own opacity shows its splat") {
  TestScene scene = thinDiscScene(1.0f, false);
  scene.model.log_scale[0] = glm::log(glm::vec3(0.0125f, 12.0f, 12.0f));  // edge-on
  scene.model.mean[0] = {0.04f, 0.0f, 100.0f};
  scene.model.opacity_logit[0] = -2.0f;
  for (const auto intersection : kModels) {
    RenderSettings settings = everything(intersection);
    settings.antialiasing = Antialiasing::screen;
    const auto reference = renderReference(ReferenceModel(scene.model), scene.camera, settings);
    const Frame frame = renderCpu(scene.model, scene.camera, settings);
    INFO(name(intersection));
    CHECK(strays(frame.ellipsoids, reference.ellipsoids, 1e-3) <= 0.02);
    if (intersection == IntersectionModel::plane) {
      CHECK(strays(frame.ellipsoids, std::vector<glm::dvec3>(reference.ellipsoids.size(), settings.background), 0.1) >
            0.02);
    }
  }
}

TEST_CASE("antialiased discs and dots of any thinness are as those of a millionth, in the picture alone, too") {
  for (const bool dot : {false, true}) {
    const auto scene = [&](float thinness) {
      TestScene made = thinDiscScene(thinness, true);
      if (dot) made.model.log_scale[0] = glm::vec3(std::log(thinness));
      return made;
    };
    for (const auto intersection : kModels) {
      RenderSettings settings = pictureAlone(intersection);
      settings.antialiasing = Antialiasing::screen;
      const auto reference = renderReference(ReferenceModel(scene(1e-6f).model), scene(1e-6f).camera, settings);
      for (const float thinness : {1e-9f, 1e-17f, 1e-20f, 1e-22f, 1e-30f}) {
        INFO(thinness << ", " << name(intersection) << ", " << dot);
        const Frame frame = renderCpu(scene(thinness).model, scene(thinness).camera, settings);
        double most = 0;
        for (std::size_t i = 0; i < frame.picture.size(); ++i) {
          most = std::max(most, glm::length(glm::dvec3(frame.color(i)) - reference.color(i)));
        }
        CHECK(most < 1e-4);
      }
    }
  }
}

TEST_CASE("two opaque splats end a ray where they end the reference's") {
  const TestScene scene = opaqueDiscsScene();
  constexpr std::size_t kPixel = 16 * 32 + 16;
  for (const auto intersection : kModels) {
    for (const auto order : {SplatOrder::global, SplatOrder::perPixel}) {
      INFO(name(intersection) << ", " << name(order));
      RenderSettings settings = everything(intersection), alone = pictureAlone(intersection);
      settings.order = alone.order = order;
      settings.background = alone.background = glm::vec3(1.0f);
      const auto reference = renderReference(ReferenceModel(scene.model), scene.camera, settings);
      const Frame frame = renderCpu(scene.model, scene.camera, settings);
      const Frame picture = renderCpu(scene.model, scene.camera, alone);
      REQUIRE(reference.count[kPixel] == 1.0);
      CHECK(frame.count[kPixel] == 1.0f);
      CHECK(glm::length(glm::dvec3(frame.color(kPixel)) - reference.color(kPixel)) < 1e-5);
      CHECK(glm::length(glm::dvec3(picture.color(kPixel)) - reference.color(kPixel)) < 1e-5);
    }
  }
}

TEST_CASE("an axis whose scale no number holds is drawn as the thinnest one, in every output") {
  for (const auto intersection : kModels) {
    TestScene scene = thinDiscScene(2e-9f, true), thinner = scene;
    thinner.model.log_scale[0].z = -400.0f;
    INFO(name(intersection));
    const auto reference = renderReference(ReferenceModel(scene.model), scene.camera, everything(intersection));
    const auto found = renderReference(ReferenceModel(thinner.model), scene.camera, everything(intersection));
    const Frame frame = renderCpu(thinner.model, scene.camera, everything(intersection));
    for (std::size_t i = 0; i < frame.base.size(); ++i) {
      REQUIRE(glm::length(found.color(i) - reference.color(i)) < 1e-6);
      REQUIRE(glm::length(glm::dvec3(frame.color(i)) - reference.color(i)) < 1e-4);
    }
  }
}

TEST_CASE("an axis longer than any number is drawn as the longest one in every output") {
  for (const auto intersection : kModels) {
    for (const glm::vec3 log_scale :
         {glm::vec3(720.0f, 1.0f, 0.0f), glm::vec3(720.0f), glm::vec3(2.0f, -1.0f, 90.0f)}) {
      for (const float splat_scale : {1.0f, 3.0f}) {
        TestScene scene = thinDiscScene(1.0f, true);
        scene.model.opacity_logit[0] = 0.0f;
        TestScene longest = scene;
        scene.model.log_scale[0] = log_scale;
        longest.model.log_scale[0] = glm::log(glm::clamp(glm::exp(glm::min(log_scale, 80.0f)), 2e9f, 1e18f));
        INFO(name(intersection) << " " << log_scale.x << " " << log_scale.z << " " << splat_scale);
        RenderSettings settings = everything(intersection), alone = pictureAlone(intersection);
        settings.splat_scale = alone.splat_scale = splat_scale;
        const auto reference = renderReference(ReferenceModel(longest.model), scene.camera, settings);
        const auto found = renderReference(ReferenceModel(scene.model), scene.camera, settings);
        const Frame frame = renderCpu(scene.model, scene.camera, settings);
        alone.background = settings.background;
        const Frame picture = renderCpu(scene.model, scene.camera, alone);
        for (std::size_t i = 0; i < frame.base.size(); ++i) {
          REQUIRE(glm::length(found.color(i) - reference.color(i)) < 1e-5);
          REQUIRE(glm::length(glm::dvec3(frame.color(i)) - reference.color(i)) < 1e-4);
          REQUIRE(glm::length(glm::dvec3(picture.color(i)) - reference.color(i)) < 1e-4);
        }
      }
    }
  }
}

TEST_CASE("a Gaussian whose box leaves float's range before a lowered near plane is everywhere") {
  const TestScene scene = vastScene();
  for (const auto intersection : kModels) {
    INFO(name(intersection));
    RenderSettings settings = everything(intersection), alone = pictureAlone(intersection);
    settings.near = alone.near = 0.005f;
    alone.background = settings.background;
    const auto reference = renderReference(ReferenceModel(scene.model), scene.camera, settings);
    CHECK(*std::ranges::min_element(reference.alpha) > 0.9);
    const Frame frame = renderCpu(scene.model, scene.camera, settings);
    const Frame picture = renderCpu(scene.model, scene.camera, alone);
    for (std::size_t i = 0; i < frame.base.size(); ++i) {
      CHECK(glm::length(glm::dvec3(frame.color(i)) - reference.color(i)) < 1e-4);
      CHECK(glm::length(glm::dvec3(picture.color(i)) - reference.color(i)) < 1e-4);
    }
  }
}

TEST_CASE("a scene in units of any size equals the reference's and one of its own size") {
  const TestScene scene = makeScene(SceneKind::ordinary, 15);
  for (const auto intersection : kModels) {
    const RenderSettings settings = everything(intersection);
    const auto own = renderReference(ReferenceModel(scene.model), scene.camera, settings);
    for (const float unit : {0x1p31f, 0x1p34f, 0x1p56f}) {
      INFO(name(intersection) << " " << unit);
      const TestScene scaled = scaledScene(scene, unit);
      const auto reference = renderReference(ReferenceModel(scaled.model), scaled.camera, settings);
      CHECK(strays(reference.base, own.base, 2e-3) <= 0.005);
      CHECK(strays(reference.texel_density, own.texel_density, 2e-3) <= 0.005);
      checkPicture(SceneKind::ordinary, scaled, pictureAlone(intersection));
      const Frame frame = renderCpu(scaled.model, scaled.camera, settings);
      CHECK(strays(frame.base, reference.base, 2e-3) <= 0.005);
      CHECK(strays(frame.texel_density, reference.texel_density, 2e-3) <= 0.005);
    }
  }
}

TEST_CASE("quaternions of every length that models may have turn Gaussians alike bit for bit") {
  for (const auto& settings : {everything(IntersectionModel::maxResponse), pictureAlone(IntersectionModel::plane)}) {
    TestScene scene = makeScene(SceneKind::ordinary, 15);
    const std::vector<glm::vec4> rotation = scene.model.rotation;
    const Frame expected = renderCpu(scene.model, scene.camera, settings);
    for (const float length : {0x1p-72f, 0x1p-66f, 0x1p62f}) {
      for (std::size_t i = 0; i < rotation.size(); ++i) scene.model.rotation[i] = length * rotation[i];
      INFO(length);
      CHECK((renderCpu(scene.model, scene.camera, settings).picture == expected.picture));
    }
  }
}

// Most of what lies beyond +-3 sigma is faint: what it hides shows in the number of blended splats.
TEST_CASE("beyond textures every treatment equals the reference's, and another one does not") {
  for (const SceneKind kind :
       {SceneKind::edgeOn, SceneKind::flat, SceneKind::oddTextures, SceneKind::mixed, SceneKind::nearPlane}) {
    const TestScene scene = makeScene(kind, 16);
    for (const auto intersection : kModels) {
      for (const auto outside : valuesOf<TextureOutside>()) {
        INFO(name(outside));
        RenderSettings settings = everything(intersection);
        settings.outside = outside;
        checkAgainstReference(kind, scene, settings);
        settings.order = SplatOrder::perPixel;
        checkAgainstReference(kind, scene, settings);
        settings = pictureAlone(intersection);
        settings.outside = outside;
        for (const auto textures : {TextureMode::alpha, TextureMode::rgb, TextureMode::rgba}) {
          settings.textures = textures;
          checkPicture(kind, scene, settings);
        }
        settings.texture_filter = TextureFilter::footprint;
        checkPicture(kind, scene, settings);
        settings.outputs = kAllOutputs;
        checkAgainstReference(kind, scene, settings);
      }
    }
    RenderSettings settings = everything(IntersectionModel::maxResponse);
    const Frame base = renderCpu(scene.model, scene.camera, settings);
    for (const auto outside : {TextureOutside::clip, TextureOutside::edge}) {
      INFO(name(kind) << ", " << name(outside));
      settings.outside = outside;
      const auto reference = renderReference(ReferenceModel(scene.model), scene.camera, settings);
      CHECK(violations(compareFrames(base, reference, tolerance(kind, *settings.intersection)),
                       tolerance(kind, *settings.intersection)) != "");
    }
  }
}

TEST_CASE("the treatment beyond textures is the model's own unless a setting says otherwise") {
  TestScene scene = makeScene(SceneKind::flat, 17);
  RenderSettings settings = everything(IntersectionModel::maxResponse);
  settings.outside = TextureOutside::clip;
  const Frame clipped = renderCpu(scene.model, scene.camera, settings);
  settings.outside.reset();
  const Frame base = renderCpu(scene.model, scene.camera, settings);
  CHECK(base.count != clipped.count);
  scene.model.outside = TextureOutside::clip;
  CHECK(renderCpu(scene.model, scene.camera, settings).base == clipped.base);
  settings.outside = TextureOutside::base;
  CHECK(renderCpu(scene.model, scene.camera, settings).base == base.base);
  settings.outside.reset();
  settings.textures = TextureMode::none;
  const Frame untextured = renderCpu(scene.model, scene.camera, settings);
  scene.model.outside = TextureOutside::base;
  CHECK(renderCpu(scene.model, scene.camera, settings).count == untextured.count);
}

TEST_CASE("every SIMD target treats what lies beyond textures as the reference does") {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    INFO(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    for (const auto outside : {TextureOutside::clip, TextureOutside::edge}) {
      for (const SceneKind kind : {SceneKind::oddTextures, SceneKind::nearPlane}) {
        RenderSettings settings = pictureAlone(IntersectionModel::plane);
        settings.outside = outside;
        checkPicture(kind, makeScene(kind, 18), settings);
        settings.outputs = kAllOutputs;
        checkAgainstReference(kind, makeScene(kind, 18), settings);
      }
    }
    hwy::SetSupportedTargetsForTest(0);
  }
}

TEST_CASE("a picture alone equals the reference's on every kind of scene, in both models") {
  for (const SceneKind kind : kSceneKinds) {
    for (const auto intersection : kModels) {
      for (const auto textures : {TextureMode::none, TextureMode::rgba}) {
        RenderSettings settings = pictureAlone(intersection);
        settings.textures = textures;
        checkPicture(kind, makeScene(kind, 21), settings);
        checkPicture(kind, makeScene(kind, 22, 300, 83, 70), settings);
      }
    }
  }
}

TEST_CASE("a picture alone of 5 x 7 and 8 x 8 textures that cross the near plane equals the reference's") {
  for (const TextureOutside outside : {TextureOutside::base, TextureOutside::clip, TextureOutside::edge}) {
    for (const auto& [width, height] : {std::pair<std::uint16_t, std::uint16_t>(5, 7), {8, 8}}) {
      TestScene scene = makeScene(SceneKind::nearPlane, 26);
      Random random(27);
      scene.model.atlas = makeUniformAtlas(scene.model.size(), width, height);
      for (glm::vec4& texel : scene.model.atlas.texels) {
        texel = {0.3 * random.normal(), 0.3 * random.normal(), 0.3 * random.normal(), random.uniform()};
      }
      RenderSettings settings = pictureAlone(IntersectionModel::maxResponse);
      settings.outside = outside;
      checkPicture(SceneKind::nearPlane, scene, settings);
    }
  }
}

TEST_CASE("a picture alone with every setting equals the reference's") {
  for (const auto intersection : kModels) {
    for (const auto textures : {TextureMode::none, TextureMode::rgba}) {
      RenderSettings settings = pictureAlone(intersection);
      settings.textures = textures;
      settings.opacity_scale = 1.7f;
      settings.splat_scale = 0.4f;
      settings.max_sh_degree = 2;
      checkPicture(SceneKind::mixed, makeScene(SceneKind::mixed, 23), settings);
      settings.splat_scale = 0.2f;
      settings.antialiasing = Antialiasing::screen;
      for (const SceneKind kind : {SceneKind::mixed, SceneKind::flat, SceneKind::needles, SceneKind::edgeOn}) {
        checkPicture(kind, makeScene(kind, 24), settings);
      }
      settings = pictureAlone(intersection);
      settings.textures = textures;
      settings.opacity_scale = 0.25f;
      settings.max_sh_degree = 0;
      settings.near = 2.5f;
      settings.crop = CropBox{{-1.0f, -0.75f, -10.0f}, {1.0f, 10.0f, 10.0f}};
      checkPicture(SceneKind::mixed, makeScene(SceneKind::mixed, 25), settings);
      settings = pictureAlone(intersection);
      settings.textures = textures;
      settings.near = 0.05f;
      checkPicture(SceneKind::nearPlane, makeScene(SceneKind::nearPlane, 26), settings);
      settings.texture_filter = TextureFilter::footprint;
      checkPicture(SceneKind::mixed, makeScene(SceneKind::mixed, 27), settings);
    }
  }
}

TEST_CASE("a picture alone has the same bytes for any number of threads, and no other outputs") {
  const TestScene scene = makeScene(SceneKind::mixed, 28, 5000, 100, 80);  // more than one chunk of Gaussians
  for (const auto textures : {TextureMode::none, TextureMode::rgba}) {
    RenderSettings settings = pictureAlone(IntersectionModel::maxResponse);
    settings.textures = textures;
    setThreadCount(1);
    const Frame one = renderCpu(scene.model, scene.camera, settings);
    CHECK(one.base.empty());
    CHECK(one.depth.empty());
    for (const int threads : {2, 3, 8}) {
      setThreadCount(threads);
      const Frame frame = renderCpu(scene.model, scene.camera, settings);
      CHECK(frame.picture == one.picture);
      CHECK(frame.alpha == one.alpha);
    }
    setThreadCount(0);
  }
}

TEST_CASE("a picture alone is the same on every SIMD target of this machine") {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    INFO(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    for (const SceneKind kind : {SceneKind::ordinary, SceneKind::oddTextures, SceneKind::nearPlane}) {
      for (const auto textures : {TextureMode::none, TextureMode::rgba}) {
        RenderSettings settings = pictureAlone(IntersectionModel::maxResponse);
        settings.textures = textures;
        checkPicture(kind, makeScene(kind, 29), settings);
      }
    }
    hwy::SetSupportedTargetsForTest(0);
  }
}

// What float cannot hold is left out; the general stages draw it in double.
TEST_CASE("a picture alone of scales and means beyond any picture is finite") {
  TestScene scene = makeScene(SceneKind::ordinary, 6, 40);
  const float beyond[] = {-1e30f, -200.0f, 88.0f, 200.0f, 1e30f};
  for (std::size_t i = 0; i < scene.model.size(); ++i) {
    if (i % 4 == 0) scene.model.log_scale[i][static_cast<int>(i % 3)] = beyond[i / 4 % 5];
    if (i % 4 == 1) scene.model.mean[i] *= i % 8 == 1 ? 1e30f : 1e-30f;
    if (i % 4 == 2) scene.model.opacity_logit[i] = i % 8 == 2 ? 1e30f : -1e30f;
    if (i % 4 == 3) scene.model.rotation[i] *= i % 8 == 3 ? 1e-18f : 1e18f;
  }
  RenderSettings settings = pictureAlone(IntersectionModel::maxResponse);
  settings.textures = TextureMode::none;
  const Frame frame = renderCpu(scene.model, scene.camera, settings);
  for (std::size_t i = 0; i < frame.picture.size(); ++i) {
    REQUIRE(std::isfinite(frame.picture[i].x + frame.picture[i].y + frame.picture[i].z + frame.alpha[i]));
  }
}

TEST_CASE("the per-pixel order's picture alone is that of a whole frame") {
  const TestScene scene = makeScene(SceneKind::mixed, 16, 200, 70, 40);
  RenderSettings settings;
  settings.order = SplatOrder::perPixel;
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
  Camera camera = resized(bundle.cameras.front(), bundle.cameras.front().size.x / 2, bundle.cameras.front().size.y / 2);
  RenderSettings settings;
  settings.outputs = kAllOutputs;
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

TEST_CASE("a setting changes the outputs that its row names, and no others") {
  // Settings that one view of one model may not show: the union over several is what they change.
  std::map<std::string_view, OutputSet> changed;
  for (const SceneKind kind : {SceneKind::ordinary, SceneKind::mixed, SceneKind::stacked, SceneKind::oddTextures}) {
    TestScene scene = makeScene(kind, 5, 300, 64, 48);
    if (kind == SceneKind::oddTextures) scene.camera = resized(scene.camera, 24, 18);  // texels smaller than pixels
    scene.model.intersection = IntersectionModel::maxResponse;
    const auto renderer = makeCpuRenderer();
    renderer->setModel(scene.model);
    // As --render asks, one output at a time.
    const auto drawn = [&](RenderSettings settings, Output output) {
      settings.outputs = {output};
      return visualize(renderer->render(scene.camera, settings), output, settings).data;
    };
    for (const Output output : valuesOf<Output>()) {
      const std::vector<float> usual = drawn({}, output);
      for (const RenderSetting& row : renderSettings()) {
        RenderSettings settings;
        row.set(settings, otherValue(row), "");
        if (drawn(settings, output) != usual) changed[row.name] = changed[row.name] | OutputSet{output};
      }
    }
  }
  for (const RenderSetting& row : renderSettings()) {
    for (const Output output : valuesOf<Output>()) {
      INFO(row.name << ", " << name(output));
      CHECK(changed[row.name].has(output) == row.outputs.has(output));
    }
  }
}

TEST_CASE("every setting makes of a picture what it makes of the reference's") {
  CHECK(ignoredSettings(drawnByCpu) == "");
}

TEST_CASE("every output shows something and what the reference's shows") { CHECK(undrawnOutputs(drawnByCpu) == ""); }
