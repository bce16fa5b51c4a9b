// SPDX-License-Identifier: Apache-2.0
// Emulated viewers against what their formulas give for a Gaussian or two, worked out here by hand.
#include "render/affine/affine_picture.h"

#include <cmath>
#include <fstream>
#include <iterator>
#include <string>

#include "core/model/verbs.h"
#include "shared/limits.h"
#include "support/catch.h"

using namespace tg;

namespace {

constexpr int kSide = 65;      // [px] odd: a pixel's centre is the picture's
constexpr float kFocal = 100;  // [px]
constexpr float kByte = 1 / 255.0f;

Camera cameraAtOrigin() {
  Camera camera;
  camera.focal = glm::dvec2(kFocal);
  camera.center = glm::dvec2(0.5 * kSide);
  camera.size = {kSide, kSide};
  return camera;
}

// Grey of 0.5 at full light.
void addBall(GaussianModel& model, glm::vec3 mean, glm::vec3 sigma, float opacity) {
  model.mean.push_back(mean);
  model.rotation.emplace_back(1, 0, 0, 0);
  model.log_scale.push_back(glm::log(sigma));
  model.opacity_logit.push_back(logitFromOpacity(opacity));
  model.sh.emplace_back(0.0f);
}

// Light of the middle row at `x` pixels from the middle.
float lightAt(const GaussianModel& model, SplatViewer viewer, int x) {
  return ViewerPicture(model, viewer).render(cameraAtOrigin(), glm::vec3(0.0f)).at(kSide / 2 + x, kSide / 2, 0);
}

}  // namespace

TEST_CASE("an emulated viewer draws a far ball with its blur, its compensation, its falloff and its cut") {
  GaussianModel model;
  addBall(model, {0, 0, 10}, glm::vec3(0.4f), 0.8f);  // 4 px on the screen
  for (const SplatViewer viewer : valuesOf<SplatViewer>()) {
    CAPTURE(name(viewer));
    // Read off the viewers' shaders: [px^2], [sigma].
    const bool sharp = viewer == SplatViewer::three || viewer == SplatViewer::spark;
    const float blur = sharp ? 0.3f : viewer == SplatViewer::cesium ? 0.3f / 16 : 0.075f;
    const float cut = viewer == SplatViewer::three ? 2.0f : std::sqrt(8.0f);
    const float variance = 16.0f + blur, peak = sharp ? 0.8f * 16.0f / variance : 0.8f;
    for (int x = -14; x <= 14; ++x) {
      CAPTURE(x);
      const float d = static_cast<float>(x);
      float value = std::exp(-0.5f * d * d / variance);
      if (viewer == SplatViewer::playcanvas) value = (value - std::exp(-4.0f)) / (1 - std::exp(-4.0f));
      const bool beyond = d * d > cut * cut * variance;
      // A byte of the opacity, one of the canvas; PlayCanvas and Spark keep sigmas to 4 %.
      const bool coarse = viewer == SplatViewer::playcanvas || viewer == SplatViewer::spark;
      CHECK(lightAt(model, viewer, x) ==
            Approx(beyond ? 0.0f : 0.5f * peak * value).margin(coarse ? 0.03f : 1.6f * kByte));
    }
    CHECK(lightAt(model, viewer, static_cast<int>(cut * std::sqrt(variance)) + 2) == 0.0f);
  }
}

TEST_CASE("the page of browsers has the version of every viewer whose drawing is emulated") {
  std::ifstream file("docs/lab/browsers.md");
  const std::string page{std::istreambuf_iterator<char>(file), {}};
  const std::size_t table = page.find("| blur, of the variance");
  REQUIRE(table != std::string::npos);
  const std::string columns = page.substr(0, table);
  const std::string heading = columns.substr(columns.rfind("\n| | "));
  for (const SplatViewer viewer : valuesOf<SplatViewer>()) {
    const std::string program(profileOf(viewer).program);  // "CesiumJS 1.135 (its decoder)"
    CHECK_THAT(heading, Contains(" " + program.substr(0, program.find(" (")) + " |"));
  }
}

TEST_CASE("an emulated viewer leaves out what has its mean beyond its guard, however far it reaches in") {
  for (const SplatViewer viewer : valuesOf<SplatViewer>()) {
    CAPTURE(name(viewer));
    const float guard = profileOf(viewer).guard;
    const float edge = 0.5f * kSide / kFocal * 10;  // of the picture [world units] at z = 10
    for (const float place : {1.1f, 1.3f, 1.5f}) {
      GaussianModel model;
      addBall(model, {place * edge, 0, 10}, glm::vec3(3.0f), 0.9f);
      CAPTURE(place);
      CHECK((lightAt(model, viewer, kSide / 2) > 0) == (guard == 0 || place < guard));
    }
  }
}

TEST_CASE("an emulated viewer projects affinely: an off-axis ball is a longer ellipse around the mean's pixel") {
  // d(x / z) = dx / z - x dz / z^2: the variance along x grows by 1 + (x / z)^2.
  GaussianModel model;
  addBall(model, {2, 0, 10}, glm::vec3(0.3f), 0.9f);
  const KeptSplats kept = keepSplats(model, SplatViewer::three, false);
  const std::vector<AffineSplat> seen = seenSplats(kept, SplatViewer::three, {cameraAtOrigin()});
  REQUIRE(seen.size() == 1);
  CHECK(seen[0].center.x == Approx(0.5f * kSide + 20));
  CHECK(seen[0].covariance.x == Approx(9.0f * 1.04f));
  CHECK(seen[0].covariance.z == Approx(9.0f));
  CHECK(std::abs(seen[0].covariance.y) < 1e-4f);
}

TEST_CASE("an emulated viewer has the nearer of two in front, Spark by distance") {
  GaussianModel model;
  addBall(model, {0, 0, 5}, glm::vec3(0.5f), 0.99f);
  addBall(model, {0, 0, 8}, glm::vec3(0.8f), 0.99f);
  model.sh[0] = glm::vec3(1.0f);
  for (const SplatViewer viewer : valuesOf<SplatViewer>()) {
    CAPTURE(name(viewer));
    CHECK(lightAt(model, viewer, 0) > 0.7f);
  }
}

TEST_CASE("the affine picture's derivative is the quotient of differences") {
  GaussianModel model;
  addBall(model, {0.3f, 0.1f, 10}, {0.9f, 0.5f, 0.7f}, 0.6f);
  addBall(model, {-0.5f, 0.2f, 9}, {0.5f, 0.8f, 0.6f}, 0.4f);
  addBall(model, {0.1f, -0.3f, 11}, {1.2f, 0.9f, 0.4f}, 0.7f);
  model.sh[1] = {0.9f, -0.5f, 0.2f};
  const Camera camera = cameraAtOrigin();
  const Image target(kSide, kSide, 3, 0.3f);
  std::vector<AffineGradient> gradients, ignored;
  for (const SplatViewer viewer : {SplatViewer::three, SplatViewer::playcanvas, SplatViewer::babylon}) {
    CAPTURE(name(viewer));
    const auto lossOf = [&](const KeptSplats& splats, std::vector<AffineGradient>& out) {
      return affineLoss(seenSplats(splats, viewer, {camera}), viewer, {camera}, glm::vec3(0.1f), target, out);
    };
    const KeptSplats kept = keepSplats(model, viewer, false);
    const std::vector<AffineSplat> seen = seenSplats(kept, viewer, {camera});
    REQUIRE(seen.size() == 3);
    lossOf(kept, gradients);
    for (std::size_t k = 0; k < seen.size(); ++k) {
      const std::size_t i = seen[k].gaussian;
      CAPTURE(i);
      const auto quotient = [&](const auto& move, double step) {
        KeptSplats up = kept, down = kept;
        move(up, static_cast<float>(step)), move(down, static_cast<float>(-step));
        return (lossOf(up, ignored) - lossOf(down, ignored)) / (2 * step);
      };
      const auto close = [](double expected) { return Approx(expected).epsilon(0.05).margin(4e-5); };
      CHECK(static_cast<double>(gradients[k].opacity) ==
            close(quotient([i](KeptSplats& s, float d) { s.opacity[i] += d; }, 0.01)));
      CHECK(static_cast<double>(gradients[k].color.y) * static_cast<double>(kShC0) ==
            close(quotient([i](KeptSplats& s, float d) { s.sh[i].y += d; }, 0.02)));
      // On the axis a variance in space is (f / z)^2 as much on the screen.
      const double screen = std::pow(static_cast<double>(kFocal / model.mean[i].z), 2);
      // The cut goes over whole pixels, for which the derivative has a ramp; without it half of some is missing.
      const auto near = [](double expected) { return Approx(expected).epsilon(0.2).margin(1.5e-4); };
      CHECK(static_cast<double>(gradients[k].covariance.z) * screen ==
            near(quotient([i](KeptSplats& s, float d) { s.covariance[i][3] += d; }, 0.01)));
      // A step of a pixel: the cut takes in whole ones.
      CHECK(static_cast<double>(gradients[k].center.y) * std::sqrt(screen) ==
            near(quotient([i](KeptSplats& s, float d) { s.mean[i].y += d; }, 0.1)));
    }
  }
}

TEST_CASE("the affine picture's derivative ends where nothing shows through") {
  GaussianModel model;
  for (int k = 0; k < 300; ++k) addBall(model, {0, 0, 10}, {0.5f, 0.5f, 0.5f}, 0.999f);
  const Camera camera = cameraAtOrigin();
  for (const SplatViewer viewer : valuesOf<SplatViewer>()) {
    CAPTURE(name(viewer));
    const std::vector<AffineSplat> seen = seenSplats(keepSplats(model, viewer, false), viewer, {camera});
    std::vector<AffineGradient> gradients;
    affineLoss(seen, viewer, {camera}, glm::vec3(0.1f), Image(kSide, kSide, 3, 0.3f), gradients);
    REQUIRE(gradients.size() == 300);
    CHECK(std::abs(gradients.back().color.x) > 0);  // the foremost
    CHECK(std::abs(gradients[0].color.x) < std::abs(gradients.back().color.x));
    for (const AffineGradient& gradient : gradients) {
      REQUIRE(std::isfinite(glm::dot(gradient.color, gradient.color) + gradient.opacity));
      REQUIRE(std::isfinite(glm::dot(gradient.covariance, gradient.covariance)));
      REQUIRE(std::isfinite(glm::dot(gradient.center, gradient.center)));
    }
  }
}
