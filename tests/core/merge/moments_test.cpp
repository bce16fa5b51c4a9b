// SPDX-License-Identifier: Apache-2.0
// Gaussians as moments: areas from the covariance alone are those of its axes.
#include "core/merge/moments.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <random>

#include "core/merge/merged_texture.h"
#include "core/model/atlas.h"
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

TEST_CASE("A merged texture lies on the axes that stored sigmas say, which float may make equal", "[core]") {
  GaussianModel model;
  model.sh_degree = 0;
  model.texture_mode = TextureMode::rgba;
  model.mean.assign(2, glm::vec3(0.0f));
  model.rotation.assign(2, {1, 0, 0, 0});
  model.log_scale.assign(2, glm::log(glm::vec3(0.7f, 1.0f, 0.4f)));
  model.opacity_logit.assign(2, 0.0f);
  model.sh.assign(2, glm::vec3(0.0f));
  model.atlas = makeUniformAtlas(2, 4, 4);
  for (std::size_t i = 0; i < model.atlas.texels.size(); ++i) {
    model.atlas.texels[i] = {0.01f * static_cast<float>(i % 16), 0, 0, 1.0f - 0.05f * static_cast<float>(i % 7)};
  }
  MergedShape shape{glm::dvec3(0.0), {0.5, 0.5, 0.8}, glm::dmat3(1.0), glm::dvec3(0.0), 0.5};
  AxisFits fits;
  const MergedTexture equal = mergedTexture(model, 0, 1, shape, fits);
  shape.sigma.y *= 1.0 - 1e-15;
  const MergedTexture almost = mergedTexture(model, 0, 1, shape, fits);
  shape.sigma.y *= 0.999;
  const MergedTexture shorter = mergedTexture(model, 0, 1, shape, fits);
  const auto differ = [&](const MergedTexture& other) {
    float most = 0.0f;
    for (std::size_t i = 0; i < equal.texels.size(); ++i) {
      most = std::max(most, glm::distance(equal.texels[i], other.texels.at(i)));
    }
    return most;
  };
  CHECK(differ(almost) < 1e-5f);
  CHECK(differ(shorter) > 0.02f);
}
