// SPDX-License-Identifier: Apache-2.0
// Gaussians as moments: areas from the covariance alone are those of its axes.
#include "core/merge/moments.h"

#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <random>

#include "support/catch.h"

using namespace tg;

namespace {

GaussianMoments momentsOf(glm::dvec3 sigma, const glm::dmat3& axes = glm::dmat3(1.0)) {
  GaussianMoments moments;
  glm::dmat3 scaled = axes;
  for (int k = 0; k < 3; ++k) scaled[k] *= sigma[k];
  moments.covariance = scaled * glm::transpose(scaled);
  return moments;
}

}  // namespace

TEST_CASE("The area of moments is that of their two longer axes", "[core]") {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 2000; ++i) {
    const glm::dquat turn = glm::normalize(glm::dquat(normal(random), normal(random), normal(random), normal(random)));
    const glm::dvec3 sigma = glm::exp(1.5 * glm::dvec3(normal(random), normal(random), normal(random)) - 3.0);
    const GaussianMoments moments = momentsOf(sigma, glm::mat3_cast(turn));
    glm::dmat3 axes;
    CAPTURE(i, sigma.x, sigma.y, sigma.z);
    CHECK(areaOf(moments) == Approx(areaOf(sigma)).epsilon(1e-7));
    CHECK(areaOf(moments) == Approx(areaOf(sigmaOf(moments, axes))).epsilon(1e-7));
  }
}

TEST_CASE("Areas of balls and discs and needles and points", "[core]") {
  CHECK(areaOf(momentsOf(glm::dvec3(0.5))) == Approx(0.25).epsilon(1e-12));
  CHECK(areaOf(momentsOf({2.0, 3.0, 0.0})) == Approx(6.0).epsilon(1e-12));
  CHECK(areaOf(momentsOf({1e-3, 5.0, 1e-3})) == Approx(5e-3).epsilon(1e-8));
  CHECK(areaOf(momentsOf({0.0, 3.0, 0.0})) == Approx(3.0 * std::sqrt(kLeastVariance)).epsilon(1e-12));
  CHECK(areaOf(momentsOf(glm::dvec3(0.0))) == kLeastVariance);
  CHECK(areaOf(momentsOf(glm::dvec3(1e-15))) == Approx(kLeastVariance).epsilon(1e-12));
  CHECK(areaOf(momentsOf({1e50, 1e50, 1e20})) == Approx(1e100).epsilon(1e-12));
}
