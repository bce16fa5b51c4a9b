// SPDX-License-Identifier: Apache-2.0
// The reference still renders what it rendered when the golden frames were looked at, and grazing angles stay tame.
#include <cmath>
#include <cstring>
#include <filesystem>

#include "core/file/file.h"
#include "goldens/goldens.h"
#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

TEST_CASE("the reference renders the golden frames") {
  for (const Golden& golden : renderGoldens()) {
    INFO(golden.name << ": regenerate with build/bin/tg_make_goldens, then look at the pictures");
    const std::filesystem::path path = std::filesystem::path(TG_GOLDENS) / (golden.name + ".f32");
    const auto bytes = readFile(path, 1 << 20);
    const std::vector<float> values = goldenValues(golden.frame);
    REQUIRE(bytes.size() == values.size() * sizeof(float));
    std::vector<float> stored(values.size());
    std::memcpy(stored.data(), bytes.data(), bytes.size());
    float worst = 0.0f;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const float difference = std::abs(values[i] - stored[i]) / std::max(1.0f, std::abs(stored[i]));
      if (!(difference <= worst)) worst = difference;
    }
    CHECK(worst <= 1e-6f);
    CHECK(std::filesystem::file_size(std::filesystem::path(path).replace_extension(".png")) <= 4096);
  }
}

TEST_CASE("a textured Gaussian turned from 0 to 89.9 degrees stays bounded and changes smoothly") {
  for (IntersectionModel intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
    RenderSettings settings;
    settings.intersection = intersection;
    FrameT<double> before;
    double area_before = 0.0;
    for (int step = 0; step < 900; ++step) {
      const TestScene scene = grazingScene(0.1 * step);
      const auto frame = renderReference(ReferenceModel(scene.model), scene.camera, settings);
      double area = 0.0, worst_change = 0.0;
      bool bounded = true;
      for (std::size_t i = 0; i < frame.alpha.size(); ++i) {
        const double alpha = frame.alpha[i];
        area += alpha;
        bounded = bounded && alpha >= 0.0 && alpha <= 0.99 && glm::length(frame.normal[i]) <= 1.0;
        // The colour of one splat: alpha times its base, and alpha times at most its largest texel.
        bounded = bounded && glm::all(glm::lessThanEqual(glm::abs(frame.texture[i]), glm::dvec3(0.3 * alpha + 1e-12)));
        bounded = bounded && frame.base[i].r >= 0.0 && frame.base[i].r <= alpha;
        // 3.33 sigma of 0.6 around a mean at depth 4.
        bounded = bounded && (frame.count[i] == 0.0 ? frame.depth[i] == 0.0 : std::abs(frame.depth[i] - 4.0) < 2.0);
        if (step > 0) worst_change = std::max(worst_change, std::abs(alpha - before.alpha[i]));
      }
      INFO(name(intersection) << " at " << 0.1 * step << " degrees");
      CHECK(bounded);  // also false where a value is not a number
      // A tenth of a degree moves no pixel by more than a hundredth; the cut at 1/255 is 0.004 of that.
      CHECK(worst_change < 0.01);
      if (step > 0) CHECK(area < area_before + 0.01);
      before = frame;
      area_before = area;
    }
    CHECK(area_before > 5.0);  // the column of pixels whose rays pass through the mean
  }
}

TEST_CASE("at 90 degrees the plane model draws nothing and the maximum response its thin side") {
  const TestScene scene = grazingScene(90.0);
  RenderSettings settings;
  settings.intersection = IntersectionModel::plane;
  const auto plane = renderReference(ReferenceModel(scene.model), scene.camera, settings);
  settings.intersection = IntersectionModel::maxResponse;
  const auto response = renderReference(ReferenceModel(scene.model), scene.camera, settings);
  const std::size_t center = std::size_t{12} * 32 + 16;
  CHECK(plane.count[center] == 0.0);
  CHECK(plane.alpha[center] == 0.0);
  CHECK(response.count[center] == 1.0);
  CHECK(response.alpha[center] > 0.5);
  for (std::size_t i = 0; i < plane.alpha.size(); ++i) CHECK((std::isfinite(plane.alpha[i]) && plane.alpha[i] < 0.99));
}
