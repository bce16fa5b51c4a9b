// SPDX-License-Identifier: Apache-2.0
// Adam against float64, and moments that follow every change of size.
#include "training/step/optimizer.h"

#include <cmath>

#include "core/system/parallel.h"
#include "support/catch.h"
#include "core/system/random.h"
#include "training/step/textures.h"
#include "training/step/update.h"

namespace {

tg::TrainingState randomState(std::size_t count, int sh_degree, std::uint64_t seed) {
  tg::Random random(seed);
  const auto value = [&] { return static_cast<float>(random.normal()); };
  tg::TrainingState state;
  tg::GaussianModel& model = state.model;
  model.sh_degree = sh_degree;
  for (std::size_t i = 0; i < count; ++i) {
    model.mean.emplace_back(value(), value(), value());
    model.rotation.emplace_back(value(), value(), value(), value());
    model.log_scale.emplace_back(value(), value(), value());
    model.opacity_logit.push_back(value());
    for (std::size_t k = 0; k < model.shCount(); ++k) model.sh.emplace_back(value(), value(), value());
  }
  tg::resetMoments(state);
  return state;
}

tg::ModelGradient randomGradient(const tg::GaussianModel& model, std::uint64_t seed) {
  tg::Random random(seed);
  const auto value = [&] { return static_cast<float>(random.normal()); };
  tg::ModelGradient gradient;
  for (std::size_t i = 0; i < model.size(); ++i) {
    gradient.mean.emplace_back(value(), value(), value());
    gradient.rotation.emplace_back(value(), value(), value(), value());
    gradient.log_scale.emplace_back(value(), value(), value());
    gradient.opacity_logit.push_back(value());
  }
  for (std::size_t i = 0; i < model.sh.size(); ++i) gradient.sh.emplace_back(value(), value(), value());
  for (std::size_t i = 0; i < model.atlas.texels.size(); ++i) {
    gradient.texels.emplace_back(value(), value(), value(), value());
  }
  return gradient;
}

}  // namespace

TEST_CASE("Adam follows the published update", "[optimizer]") {
  // One parameter, gradients 1, -2, 0, 0.5 at rate 0.05: computed in float64 from Kingma and Ba's formulas.
  tg::TrainingState state = randomState(1, 0, 1);
  double value = state.model.opacity_logit[0];
  double m = 0;
  double v = 0;
  int t = 0;
  for (double g : {1.0, -2.0, 0.0, 0.5}) {
    tg::ModelGradient gradient = randomGradient(state.model, 2);
    gradient.opacity_logit[0] = static_cast<float>(g);
    tg::adamStep(state, gradient, {});
    ++t;
    m = 0.9 * m + 0.1 * g;
    v = 0.999 * v + 0.001 * g * g;
    value -= 0.05 * (m / (1 - std::pow(0.9, t))) / (std::sqrt(v / (1 - std::pow(0.999, t))) + 1e-15);
    CHECK(state.model.opacity_logit[0] == Approx(value).epsilon(1e-5));
  }
  CHECK(state.step == 4);
}

TEST_CASE("a texture that Gaussians share moves once, by the sum of what they say of it", "[optimizer]") {
  tg::TrainingState state = randomState(3, 0, 11);
  tg::addTextures(state, tg::uniformRects(3, 2, 0), tg::TextureMode::rgba, tg::TextureInit::neutral);
  tg::TrainingState summed = state;  // whose first Gaussian gets the sum itself
  const std::vector<std::uint32_t> groups = {0, 1, 0};
  tg::LearningRates rates;
  rates.texels = 0.01f;
  for (const std::uint64_t seed : {12u, 13u}) {  // twice: moments count
    tg::ModelGradient gradient = randomGradient(state.model, seed), sum = gradient;
    for (std::size_t t = 0; t < 4; ++t) sum.texels[t] += sum.texels[8 + t];
    tg::adamStep(summed, sum, rates);
    tg::sumOverGroups(state.model.atlas, groups, gradient.texels);
    tg::adamStep(state, gradient, rates, groups);
    for (std::size_t t = 0; t < 4; ++t) {
      CHECK(state.model.atlas.texels[t] == summed.model.atlas.texels[t]);
      CHECK(state.model.atlas.texels[4 + t] == summed.model.atlas.texels[4 + t]);
      CHECK(state.model.atlas.texels[8 + t] == summed.model.atlas.texels[t]);
    }
    CHECK(state.model.mean == summed.model.mean);
  }
}

TEST_CASE("every block moves at its own rate", "[optimizer]") {
  tg::TrainingState state = randomState(37, 2, 3);
  tg::addTextures(state, tg::uniformRects(state.model.size(), 3, 0), tg::TextureMode::rgba, tg::TextureInit::neutral);
  const tg::GaussianModel before = state.model;
  tg::ModelGradient gradient = randomGradient(state.model, 4);
  tg::LearningRates rates;
  rates.mean = 0.01f;
  tg::adamStep(state, gradient, rates);
  // The first bias-corrected step is the rate, against the gradient's sign.
  const auto moved = [](float from, float to, float g) { return (to - from) * (g > 0 ? -1 : 1); };
  for (std::size_t i = 0; i < 37; ++i) {
    CHECK(moved(before.mean[i].y, state.model.mean[i].y, gradient.mean[i].y) == Approx(0.01f).margin(1e-6));
    CHECK(moved(before.rotation[i].w, state.model.rotation[i].w, gradient.rotation[i].w) == Approx(1e-3f).margin(1e-6));
    CHECK(moved(before.log_scale[i].z, state.model.log_scale[i].z, gradient.log_scale[i].z) ==
          Approx(5e-3f).margin(1e-6));
    CHECK(moved(before.opacity_logit[i], state.model.opacity_logit[i], gradient.opacity_logit[i]) ==
          Approx(5e-2f).margin(1e-6));
    CHECK(moved(before.sh[i * 9].z, state.model.sh[i * 9].z, gradient.sh[i * 9].z) == Approx(2.5e-3f).margin(1e-6));
    CHECK(moved(before.sh[i * 9 + 1].x, state.model.sh[i * 9 + 1].x, gradient.sh[i * 9 + 1].x) ==
          Approx(1.25e-4f).margin(1e-6));
    CHECK(moved(before.sh[i * 9 + 8].z, state.model.sh[i * 9 + 8].z, gradient.sh[i * 9 + 8].z) ==
          Approx(1.25e-4f).margin(1e-6));
  }
  for (std::size_t i = 0; i < before.atlas.texels.size(); ++i) {
    CHECK(moved(0, state.model.atlas.texels[i].g, gradient.texels[i].g) == Approx(1e-3f).margin(1e-6));
    // Alpha starts at 1 and is clamped there.
    CHECK(state.model.atlas.texels[i].a == Approx(gradient.texels[i].a > 0 ? 0.999f : 1.0f).margin(1e-6));
  }
}

TEST_CASE("a step has the same bytes at any thread count", "[optimizer]") {
  tg::TrainingState one = randomState(9000, 3, 5);
  tg::TrainingState two = one;
  const tg::ModelGradient gradient = randomGradient(one.model, 6);
  tg::setThreadCount(1);
  tg::adamStep(one, gradient, {});
  tg::setThreadCount(2);
  tg::adamStep(two, gradient, {});
  tg::setThreadCount(0);
  CHECK(one.model.sh == two.model.sh);
  CHECK(one.model.rotation == two.model.rotation);
  CHECK(one.moments.sh.second == two.moments.sh.second);
}

TEST_CASE("texels decay towards no change, by a share of their rate", "[optimizer]") {
  tg::TrainingState state;
  state.model.mean = {{0, 0, 0}};
  state.model.rotation = {{1, 0, 0, 0}};
  state.model.log_scale = {{0, 0, -1}};
  state.model.opacity_logit = {0};
  state.model.sh = {{0, 0, 0}};
  tg::addTextures(state, tg::uniformRects(1, 4, 0), tg::TextureMode::rgba, tg::TextureInit::neutral);
  for (glm::vec4& texel : state.model.atlas.texels) texel = {0.5f, -1, 2, 0.25f};
  tg::ModelGradient gradient;
  tg::forEachParameter([](const tg::Field&, auto& v, const auto& values) { v.resize(values.size()); }, gradient,
                       state.model);
  tg::LearningRates rates;
  rates.texels = 0.5f;
  rates.texel_decay = 0.2f;
  tg::adamStep(state, gradient, rates);
  for (const glm::vec4& texel : state.model.atlas.texels) {
    CHECK(texel.r == Approx(0.45f));  // 1 - 0.5 * 0.2 of the distance is left
    CHECK(texel.g == Approx(-0.9f));
    CHECK(texel.b == Approx(1.8f));
    CHECK(texel.a == Approx(1 - 0.9 * 0.75));
  }
}

TEST_CASE("texels that move out of [0, 1] come back to it, colours where that is asked for", "[optimizer]") {
  tg::TrainingState state = randomState(2, 0, 11);
  tg::addTextures(state, tg::uniformRects(2, 2, 0), tg::TextureMode::rgba, tg::TextureInit::paper);
  tg::TrainingState free = state;
  tg::ModelGradient gradient = randomGradient(state.model, 12);
  for (std::size_t i = 0; i < gradient.texels.size(); ++i) gradient.texels[i] = glm::vec4(i % 2 == 0 ? -1.0f : 1.0f);
  tg::ModelGradient again = gradient;
  tg::DensityStatistics statistics;
  const tg::Camera camera;
  tg::StepInput input{{.view = 0,
                       .background = glm::vec3(0.0f),
                       .background_varies = false,
                       .iteration = 1,
                       .gradient = {},
                       .gather_statistics = false,
                       .rates = {.texels = 5},
                       .mcmc = false,
                       .opacity_weight = 0,
                       .scale_weight = 0,
                       .noise = 0,
                       .noise_seed = 0,
                       .clamp_colors = true},
                      camera,
                      nullptr};
  tg::updateParameters(state, {}, statistics, input, {0, 2}, gradient);
  input.clamp_colors = false;
  tg::updateParameters(free, {}, statistics, input, {0, 2}, again);
  for (std::size_t i = 0; i < state.model.atlas.texels.size(); ++i) {
    CHECK(state.model.atlas.texels[i] == glm::vec4(i % 2 == 0 ? 1.0f : 0.0f));
    CHECK((free.model.atlas.texels[i].r > 1) == (i % 2 == 0));
    CHECK((free.model.atlas.texels[i].r < 0) == (i % 2 != 0));
    CHECK(free.model.atlas.texels[i].a == (i % 2 == 0 ? 1.0f : 0.0f));
  }
}

TEST_CASE("position rates fall log-linearly from 1.6e-4 to 1.6e-6 of the extent", "[optimizer]") {
  CHECK(2 * tg::decayedRate(1.6e-4, 1.6e-6, 0, 1000) == Approx(3.2e-4));
  CHECK(2 * tg::decayedRate(1.6e-4, 1.6e-6, 500, 1000) == Approx(3.2e-5));
  CHECK(2 * tg::decayedRate(1.6e-4, 1.6e-6, 1000, 1000) == Approx(3.2e-6));
  CHECK(tg::decayedRate(1.6e-4, 1.6e-6, 1500, 1000) == Approx(1.6e-6));
  CHECK(tg::decayedRate(1.6e-4, 0, 500, 1000) == Approx(0.8e-4));
  for (const int iteration : {0, 500, 1000}) CHECK(tg::decayedRate(0, 1.6e-6, iteration, 1000) == 0);
}

TEST_CASE("a Gaussian's moments are forgotten, both of them and no others", "[optimizer]") {
  tg::TrainingState state = randomState(3, 1, 9);
  tg::adamStep(state, randomGradient(state.model, 10), {});
  tg::TrainingState expected = state;
  for (auto* sh : {&expected.moments.sh.first, &expected.moments.sh.second}) std::fill_n(&(*sh)[12], 12, 0.0f);
  for (auto* mean : {&expected.moments.mean.first, &expected.moments.mean.second}) std::fill_n(&(*mean)[3], 3, 0.0f);
  tg::clearMoments(state, 1);
  CHECK(state.moments.sh.first == expected.moments.sh.first);
  CHECK(state.moments.sh.second == expected.moments.sh.second);
  CHECK(state.moments.mean.first == expected.moments.mean.first);
  CHECK(state.moments.mean.second == expected.moments.mean.second);
}

TEST_CASE("moments agree with a model where both of every field have its length", "[optimizer]") {
  const tg::TrainingState whole = randomState(3, 1, 1);
  CHECK(tg::momentsAgree(whole));
  tg::TrainingState state = whole;
  state.moments.mean.first.pop_back();
  CHECK_FALSE(tg::momentsAgree(state));
  state = whole;
  state.moments.mean.second.pop_back();
  CHECK_FALSE(tg::momentsAgree(state));
}

TEST_CASE("a higher SH degree adds zeros behind each Gaussian's coefficients", "[optimizer]") {
  tg::TrainingState state = randomState(5, 1, 7);
  tg::adamStep(state, randomGradient(state.model, 8), {});
  const tg::TrainingState before = state;
  tg::growShDegree(state, 3);
  CHECK(state.model.sh_degree == 3);
  REQUIRE(state.model.sh.size() == 5 * 16);
  REQUIRE(state.moments.sh.first.size() == 5 * 48);
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t k = 0; k < 16; ++k) {
      CHECK(state.model.sh[i * 16 + k] == (k < 4 ? before.model.sh[i * 4 + k] : glm::vec3(0)));
      CHECK(state.moments.sh.second[i * 48 + k * 3] == (k < 4 ? before.moments.sh.second[i * 12 + k * 3] : 0.0f));
    }
  }
}
