// SPDX-License-Identifier: Apache-2.0
// Wide Gaussians in pieces: which ones, how many, and that they let through what the whole did.
#include "core/model/wide_splats.h"

#include <array>
#include <cmath>
#include <limits>

#include "core/model/verbs.h"
#include "support/catch.h"

using namespace tg;

namespace {

GaussianModel ballsOf(float opacity) {
  GaussianModel model;
  for (const glm::vec3 sigma : {glm::vec3(0.1f), glm::vec3(0.1f, 2.0f, 0.2f), glm::vec3(0.3f)}) {
    model.mean.emplace_back(0, 0, 10);
    model.rotation.emplace_back(2, 0, 0, 0);
    model.log_scale.push_back(glm::log(sigma));
    model.opacity_logit.push_back(logitFromOpacity(opacity));
    model.sh.emplace_back(0.25f);
  }
  return model;
}

constexpr std::array<glm::dvec3, 2> kEyes = {{{0, 0, 0}, {0, 0, -50}}};

// 1 - the light that comes through at y along the wide axis, straight at the middle of the others.
double opacityAt(const GaussianModel& pieces, double y) {
  double through = 1;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const double u = (y - static_cast<double>(pieces.mean[i].y)) / sigmaOf(pieces, i).y;
    through *= 1 - opacityOf(pieces, i) * std::exp(-0.5 * u * u);
  }
  return 1 - through;
}

}  // namespace

TEST_CASE("a Gaussian that is wide for its distance to the nearest eye becomes narrow pieces of its colour") {
  const GaussianModel model = ballsOf(0.5f);
  const WidePieces split = splitWide(model, kEyes, {.bound = 0.1});  // 2 of 10
  REQUIRE(split.wide == std::vector<std::uint32_t>{1});
  CHECK(split.pieces.size() == 9);
  CHECK(split.source == std::vector<std::uint32_t>(9, 1));
  for (std::size_t i = 0; i < split.pieces.size(); ++i) {
    CHECK(sigmaOf(split.pieces, i).y < 0.1 * 10.0);
    CHECK(split.pieces.log_scale[i].x == model.log_scale[1].x);
    CHECK(split.pieces.sh[i] == model.sh[1]);
  }
  CHECK(splitWide(model, kEyes, {.bound = 0.21}).wide.empty());
  CHECK(splitWide(model, {}, {.bound = 0.1}).wide.empty());
}

TEST_CASE("pieces let through what the whole does, faint or opaque") {
  for (const float opacity : {0.05f, 0.3f, 0.7f, 0.95f}) {
    CAPTURE(opacity);
    const GaussianModel model = ballsOf(opacity);
    const WidePieces once = splitWide(model, kEyes, {.bound = 0.15, .rounds = 1});
    REQUIRE(once.pieces.size() == 3);
    double squares = 0;
    for (int k = -60; k <= 60; ++k) {
      const double y = 0.1 * k;
      const double whole = static_cast<double>(opacity) * std::exp(-0.5 * y * y / 4);
      squares += std::pow(opacityAt(once.pieces, y) - whole, 2);
    }
    // 1 % of a faint one, 4 % of white where a row of humps cannot be as flat as an opaque whole.
    CHECK(std::sqrt(squares / 121) < 0.01 + 0.03 * static_cast<double>(opacity));
  }
}

TEST_CASE("there are no more pieces than there is room for, nor more than so many rounds make") {
  GaussianModel model = ballsOf(0.5f);
  for (glm::vec3& log_scale : model.log_scale) log_scale = glm::log(glm::vec3(1000.0f));
  CHECK(splitWide(model, kEyes, {.bound = 0.1, .rounds = 1, .most_pieces = 8}).pieces.size() == 6);
  CHECK(splitWide(model, kEyes, {.bound = 0.1, .most_pieces = 2}).pieces.size() == 0);
  CHECK(splitWide(model, kEyes, {.bound = 1e-9}).pieces.size() == 3 * 81);
  // An eye in the middle of a mean: no distance at all.
  CHECK(splitWide(model, std::array{glm::dvec3(0, 0, 10)}, {.bound = 0.1}).wide.size() == 3);
  model.log_scale[0] = glm::vec3(80.0f);  // sigmas of 1e34 stay floats
  const WidePieces huge = splitWide(model, kEyes, {.bound = 0.1});
  for (const glm::vec3& log_scale : huge.pieces.log_scale) CHECK(std::isfinite(log_scale.x));
  CHECK_NOTHROW(checkModel(huge.pieces, "pieces"));
}
