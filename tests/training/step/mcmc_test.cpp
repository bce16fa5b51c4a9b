// SPDX-License-Identifier: Apache-2.0
// Relocation keeps the picture, the count grows to its cap, and noise moves only what is nearly transparent.
#include "training/step/mcmc.h"

#include <cmath>
#include <numeric>

#include "core/system/parallel.h"
#include "support/catch.h"

namespace {

float logit(float opacity) { return std::log(opacity / (1 - opacity)); }
float sigmoid(float x) { return 1 / (1 + std::exp(-x)); }

tg::TrainingState rowOf(const std::vector<float>& opacities) {
  tg::TrainingState state;
  for (std::size_t i = 0; i < opacities.size(); ++i) {
    state.model.mean.emplace_back(i, 0, 0);
    state.model.rotation.emplace_back(1, 0, 0, 0);
    state.model.log_scale.emplace_back(std::log(0.1f));
    state.model.opacity_logit.push_back(logit(opacities[i]));
    state.model.sh.emplace_back(0.1f * static_cast<float>(i));
  }
  tg::resetMoments(state);
  std::iota(state.moments.mean.first.begin(), state.moments.mean.first.end(), 1.0f);
  return state;
}

// Integral along a line through the centre of `count` equal Gaussians blended over each other, by the midpoint rule.
double blendedLine(double opacity, double sigma, int count) {
  double sum = 0;
  constexpr int kSteps = 4000;
  for (int i = 0; i < kSteps; ++i) {
    const double x = (i + 0.5) / kSteps * 12 - 6;
    sum += 1 - std::pow(1 - opacity * std::exp(-x * x / (2 * sigma * sigma)), count);
  }
  return sum * 12 / kSteps;
}

}  // namespace

TEST_CASE("Gaussians that share a place look like the one they came from", "[mcmc]") {
  for (const float opacity : {0.02f, 0.3f, 0.9f}) {
    CHECK(tg::shareGaussian(opacity, 1).opacity == Approx(opacity));
    CHECK(tg::shareGaussian(opacity, 1).scale == Approx(1));
    for (const int count : {2, 3, 10, 50}) {
      const tg::SharedGaussian share = tg::shareGaussian(opacity, count);
      INFO(opacity << " x " << count);
      CHECK(1 - std::pow(1 - double{share.opacity}, count) == Approx(opacity).epsilon(1e-4));
      CHECK(blendedLine(share.opacity, share.scale, count) == Approx(blendedLine(opacity, 1, 1)).epsilon(1e-3));
    }
    CHECK(tg::shareGaussian(opacity, 1000).opacity == tg::shareGaussian(opacity, 50).opacity);
  }
}

TEST_CASE("dead Gaussians move onto live ones, and all at one place restart", "[mcmc]") {
  tg::TrainingState state = rowOf({0.001f, 0.8f, 0.004f, 0.9f});
  tg::Random random(1);
  const tg::McmcResult result = tg::relocateAndGrow(state, {.max_gaussians = 4}, random);
  CHECK(result.relocated == 2);
  CHECK(result.added == 0);
  REQUIRE(state.model.size() == 4);
  CHECK(state.model.mean[1].x == 1);
  CHECK(state.model.mean[3].x == 3);
  for (const std::size_t moved : {std::size_t{0}, std::size_t{2}}) {
    const float x = state.model.mean[moved].x;
    CHECK((x == 1 || x == 3));
    CHECK(state.moments.mean.first[3 * moved] == 0);
    CHECK(state.model.opacity_logit[moved] == state.model.opacity_logit[static_cast<std::size_t>(x)]);
    CHECK(state.model.log_scale[moved].x < std::log(0.1f));
    CHECK(state.moments.mean.first[3 * static_cast<std::size_t>(x)] == 0);
  }
}

TEST_CASE("the count grows by a share a round and stops at the cap exactly", "[mcmc]") {
  tg::TrainingState state = rowOf(std::vector<float>(100, 0.5f));
  tg::Random random(1);
  CHECK(tg::relocateAndGrow(state, {.max_gaussians = 107, .growth = 0.05f}, random).added == 5);
  CHECK(state.model.size() == 105);
  CHECK(state.moments.mean.first.size() == 315);
  CHECK(tg::relocateAndGrow(state, {.max_gaussians = 107}, random).added == 2);
  CHECK(tg::relocateAndGrow(state, {.max_gaussians = 107}, random).added == 0);
  CHECK(tg::relocateAndGrow(state, {.max_gaussians = 50}, random).added == 0);
  CHECK(state.model.size() == 107);
}

TEST_CASE("draws follow opacity", "[mcmc]") {
  tg::TrainingState state = rowOf({0.2f, 0.6f});
  tg::Random random(5);
  tg::relocateAndGrow(state, {.max_gaussians = 4002, .growth = 3000}, random);
  REQUIRE(state.model.size() == 4002);
  std::size_t second = 0;
  for (std::size_t i = 2; i < 4002; ++i) second += state.model.mean[i].x == 1;
  CHECK(static_cast<double>(second) / 4000 == Approx(0.75).margin(0.03));
}

TEST_CASE("when all are dead nothing moves", "[mcmc]") {
  tg::TrainingState state = rowOf({0.001f, 0.002f});
  tg::Random random(1);
  const tg::McmcResult result = tg::relocateAndGrow(state, {.max_gaussians = 10}, random);
  CHECK(result.relocated == 0);
  CHECK(result.added == 0);
}

TEST_CASE("noise follows the Gaussian's own shape and spares opaque ones", "[mcmc]") {
  constexpr int kCount = 20000;
  tg::GaussianModel model;
  for (int i = 0; i < kCount; ++i) {
    model.mean.emplace_back(0);
    model.rotation.emplace_back(1, 0, 0, 1);  // a quarter turn about z: the long axis is world y
    model.log_scale.emplace_back(std::log(2.0f), 0.0f, std::log(0.5f));
    model.opacity_logit.push_back(i % 2 == 0 ? logit(0.005f) : logit(0.5f));
  }
  const tg::GaussianModel before = model;
  tg::addExplorationNoise(model, 1e-2f, 3, 7);
  glm::dvec3 squares(0.0);
  for (int i = 0; i < kCount; i += 2) squares += glm::dvec3(model.mean[i]) * glm::dvec3(model.mean[i]);
  const glm::dvec3 deviation = glm::sqrt(squares / (kCount / 2.0));
  // Half the noise at opacity 0.005; Sigma's eigenvalues are 1, 4 and 0.25.
  CHECK(deviation.x == Approx(0.5e-2).epsilon(0.05));
  CHECK(deviation.y == Approx(4 * 0.5e-2).epsilon(0.05));
  CHECK(deviation.z == Approx(0.25 * 0.5e-2).epsilon(0.05));
  for (int i = 1; i < kCount; i += 2) REQUIRE(model.mean[i] == before.mean[i]);

  SECTION("the same for any thread count, another for another step") {
    tg::GaussianModel again = before;
    tg::setThreadCount(1);
    tg::addExplorationNoise(again, 1e-2f, 3, 7);
    tg::setThreadCount(0);
    CHECK(again.mean == model.mean);
    tg::GaussianModel other = before;
    tg::addExplorationNoise(other, 1e-2f, 3, 8);
    CHECK(other.mean[0] != model.mean[0]);
  }
}

TEST_CASE("regularisers pull by the derivative of their means", "[mcmc]") {
  const tg::TrainingState state = rowOf({0.2f, 0.7f, 0.99f});
  tg::ModelGradient gradient;
  gradient.opacity_logit.assign(3, 1.0f);
  gradient.log_scale.assign(3, glm::vec3(2.0f));
  tg::addRegularizerGradient(state.model, 0.03f, 0.09f, gradient);
  const auto loss = [](const tg::GaussianModel& model) {
    double opacity = 0, sigma = 0;
    for (int i = 0; i < 3; ++i) {
      opacity += sigmoid(model.opacity_logit[i]) / 3.0;
      for (int axis = 0; axis < 3; ++axis) sigma += std::exp(model.log_scale[i][axis]) / 9.0;
    }
    return 0.03 * opacity + 0.09 * sigma;
  };
  constexpr float kStep = 1e-2f;
  for (int i = 0; i < 3; ++i) {
    tg::GaussianModel up = state.model, down = state.model;
    up.opacity_logit[i] += kStep;
    down.opacity_logit[i] -= kStep;
    CHECK(gradient.opacity_logit[i] - 1 == Approx((loss(up) - loss(down)) / (2 * kStep)).epsilon(1e-2).margin(1e-6));
    up = down = state.model;
    up.log_scale[i].y += kStep;
    down.log_scale[i].y -= kStep;
    CHECK(gradient.log_scale[i].y - 2 == Approx((loss(up) - loss(down)) / (2 * kStep)).epsilon(1e-2).margin(1e-6));
  }
}
