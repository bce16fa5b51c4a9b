// SPDX-License-Identifier: Apache-2.0
// The pixel inspector against the reference's frame.
#include "render/reference/inspect.h"

#include <numeric>

#include "core/system/error.h"
#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

TEST_CASE("the hits of a pixel add up to the reference's picture") {
  for (const SceneKind kind : {SceneKind::mixed, SceneKind::flat, SceneKind::nearPlane, SceneKind::aroundCamera,
                               SceneKind::stacked, SceneKind::needles}) {
    const TestScene scene = makeScene(kind, 8, 150, 20, 14);
    for (const auto order : {SplatOrder::global, SplatOrder::perPixel}) {
      RenderSettings settings;
      settings.background = {0.25f, 0.5f, 0.75f};
      settings.order = order;
      settings.antialiasing = order == SplatOrder::global ? Antialiasing::off : Antialiasing::screen;
      settings.texture_filter = order == SplatOrder::global ? TextureFilter::bilinear : TextureFilter::footprint;
      const auto frame = renderReference(ReferenceModel(scene.model), scene.camera, settings);
      for (int y = 0; y < 14; ++y) {
        for (int x = 0; x < 20; ++x) {
          const auto hits = inspectPixel(scene.model, scene.camera, settings, {x, y});
          glm::dvec3 color(0.0);
          double left = 1.0;
          for (const PixelHit& hit : hits) {
            CHECK(hit.transmittance == Approx(left).epsilon(1e-12));
            color += hit.weight * (hit.base + hit.texture);
            left -= hit.weight;
          }
          color += left * glm::dvec3(settings.background);
          const std::size_t pixel = static_cast<std::size_t>(y) * 20 + x;
          INFO(name(kind) << " " << x << " " << y);
          CHECK(static_cast<double>(hits.size()) == frame.count[pixel]);
          CHECK(glm::length(color - frame.color(pixel)) < 1e-9);
        }
      }
    }
  }
}

TEST_CASE("of two opaque splats a pixel has the first alone") {
  const TestScene scene = opaqueDiscsScene();
  for (const auto order : {SplatOrder::global, SplatOrder::perPixel}) {
    RenderSettings settings;
    settings.order = order;
    const auto hits = inspectPixel(scene.model, scene.camera, settings, {16, 16});
    REQUIRE(hits.size() == 1);
    CHECK(hits[0].index == 0);
    CHECK(hits[0].weight == Approx(0.99));
  }
}

TEST_CASE("hits carry the model's indices, front to back") {
  const TestScene scene = makeScene(SceneKind::ordinary, 9, 200, 16, 12);
  RenderSettings settings;
  settings.order = SplatOrder::perPixel;
  const auto hits = inspectPixel(scene.model, scene.camera, settings, {8, 6});
  const auto expected = traceReference(ReferenceModel(scene.model), scene.camera, settings, 8.5, 6.5);
  REQUIRE(hits.size() == expected.size());
  REQUIRE(hits.size() > 1);
  for (std::size_t k = 0; k < hits.size(); ++k) {
    CHECK(hits[k].index == expected[k].gaussian);
    CHECK((k == 0 || hits[k - 1].t <= hits[k].t));
  }
}

TEST_CASE("a texture square has its corners at three sigmas on the two longer axes") {
  GaussianModel model;
  model.mean = {{1.0f, 2.0f, 3.0f}};
  model.rotation = {{2.0f, 0.0f, 0.0f, 0.0f}};
  model.log_scale = {{std::log(0.5f), std::log(0.01f), std::log(0.25f)}};
  const auto corners = textureSquare(model, 0);  // y is the shortest axis: u along x, v along z
  const glm::dvec3 expected[4] = {{-0.5, 2, 2.25}, {2.5, 2, 2.25}, {2.5, 2, 3.75}, {-0.5, 2, 3.75}};
  for (int k = 0; k < 4; ++k) CHECK(glm::length(corners[k] - expected[k]) < 1e-6);
  CHECK(glm::length(textureSquare(model, 0, 2.0)[0] - glm::dvec3(-2.0, 2.0, 1.5)) < 1e-6);
}
