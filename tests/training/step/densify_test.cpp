// SPDX-License-Identifier: Apache-2.0
// Who is cloned, split and pruned, where they end up, and what happens to their moments.
#include "training/step/densify.h"

#include <cmath>

#include "support/catch.h"

namespace {

float logit(float opacity) { return std::log(opacity / (1 - opacity)); }

// Gaussian i at x = i, first moment of its x = i + 1.
tg::TrainingState rowOf(std::size_t count) {
  tg::TrainingState state;
  for (std::size_t i = 0; i < count; ++i) {
    state.model.mean.emplace_back(i, 0, 0);
    state.model.rotation.emplace_back(1, 0, 0, 0);
    state.model.log_scale.emplace_back(std::log(0.005f));
    state.model.opacity_logit.push_back(logit(0.5f));
    state.model.sh.emplace_back(0.1f * static_cast<float>(i));
  }
  tg::resetMoments(state);
  for (std::size_t i = 0; i < count; ++i) state.moments.mean.first[3 * i] = static_cast<float>(i + 1);
  return state;
}

tg::DensityStatistics scores(const std::vector<float>& values) {
  tg::DensityStatistics statistics;
  statistics.reset(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    statistics.score_sum[i] = 2 * values[i];
    statistics.view_count[i] = 2;
    statistics.max_radius[i] = 5;
  }
  return statistics;
}

std::vector<float> positions(const tg::TrainingState& state) {
  std::vector<float> xs;
  for (const glm::vec3& mean : state.model.mean) xs.push_back(mean.x);
  return xs;
}

}  // namespace

TEST_CASE("small Gaussians with a large screen gradient are cloned at the end, with fresh moments", "[densify]") {
  tg::TrainingState state = rowOf(4);
  tg::DensityStatistics statistics = scores({1e-4f, 3e-4f, 2e-4f, 0});
  tg::Random random(1);
  const tg::DensifyResult result = tg::densify(state, statistics, {}, random);
  CHECK(result.cloned == 2);
  CHECK(result.split == 0);
  CHECK(result.pruned == 0);
  CHECK(positions(state) == std::vector<float>{0, 1, 2, 3, 1, 2});
  CHECK(state.model.sh[5] == state.model.sh[2]);
  CHECK(state.moments.mean.first[3] == 2);      // the original keeps its moment
  CHECK(state.moments.mean.first[3 * 4] == 0);  // the clone does not
  CHECK(state.moments.mean.first.size() == 18);
  CHECK(statistics.score_sum == std::vector<float>(6, 0.0f));
}

TEST_CASE("large Gaussians are split in two smaller ones drawn from them", "[densify]") {
  tg::TrainingState state = rowOf(3);
  state.model.log_scale[1] = glm::vec3(std::log(0.5f), std::log(0.1f), std::log(1e-4f));
  tg::DensityStatistics statistics = scores({0, 3e-4f, 0});
  tg::Random random(1);
  const tg::DensifyResult result = tg::densify(state, statistics, {}, random);
  CHECK(result.split == 1);
  CHECK(result.cloned == 0);
  REQUIRE(state.model.size() == 4);
  for (std::size_t child : {std::size_t{1}, std::size_t{3}}) {
    CHECK(state.model.log_scale[child].x == Approx(std::log(0.5f / 1.6f)));
    CHECK(state.model.log_scale[child].z == Approx(std::log(1e-4f / 1.6f)));
    CHECK(state.model.mean[child] != glm::vec3(1, 0, 0));
    CHECK(std::abs(state.model.mean[child].x - 1) < 5 * 0.5f);
    CHECK(std::abs(state.model.mean[child].z) < 5 * 1e-4f);
    CHECK(state.moments.mean.first[3 * child] == 0);
  }
  CHECK(state.model.mean[1] != state.model.mean[3]);
  CHECK(state.moments.mean.first[6] == 3);
}

TEST_CASE("children of a split cover their parent's spread", "[densify]") {
  // Rotated a quarter turn about z: the long axis is world y.
  double square_x = 0, square_y = 0;
  tg::Random random(3);
  constexpr int kTrials = 2000;
  for (int i = 0; i < kTrials; ++i) {
    tg::TrainingState state = rowOf(1);
    state.model.rotation[0] = {1, 0, 0, 1};
    state.model.log_scale[0] = glm::vec3(std::log(0.5f), std::log(0.1f), std::log(0.1f));
    tg::DensityStatistics statistics = scores({1});
    tg::densify(state, statistics, {}, random);
    square_x += state.model.mean[1].x * state.model.mean[1].x / kTrials;
    square_y += state.model.mean[1].y * state.model.mean[1].y / kTrials;
  }
  CHECK(std::sqrt(square_x) == Approx(0.1).epsilon(0.1));
  CHECK(std::sqrt(square_y) == Approx(0.5).epsilon(0.1));
}

TEST_CASE("transparent Gaussians are pruned, large ones only once asked to", "[densify]") {
  tg::TrainingState state = rowOf(5);
  state.model.opacity_logit[0] = logit(0.004f);
  state.model.log_scale[2].y = std::log(0.2f);
  tg::DensityStatistics statistics = scores({1, 0, 0, 0, 0});
  statistics.max_radius[3] = 30;
  tg::Random random(1);
  tg::TrainingState early = state;
  tg::DensityStatistics copy = statistics;
  CHECK(tg::densify(early, copy, {}, random).pruned == 1);
  CHECK(positions(early) == std::vector<float>{1, 2, 3, 4});
  CHECK(early.moments.mean.first[0] == 2);
  tg::DensifySettings settings;
  settings.prune_large = true;
  tg::TrainingState large = state;
  copy = statistics;
  CHECK(tg::densify(large, copy, settings, random).pruned == 2);
  CHECK(positions(large) == std::vector<float>{1, 3, 4});  // as wide on screen as it likes, as in 3DGS
  settings.prune_radius = 20;
  CHECK(tg::densify(state, statistics, settings, random).pruned == 3);
  CHECK(positions(state) == std::vector<float>{1, 4});
}

TEST_CASE("a large Gaussian that is split stays if its children are small enough", "[densify]") {
  tg::TrainingState state = rowOf(3);
  state.model.log_scale[0].x = std::log(0.15f);  // of the extent; children have 0.094
  state.model.log_scale[1].x = std::log(0.17f);  // children have 0.106
  state.model.log_scale[2].x = std::log(0.15f);  // is not split
  tg::DensityStatistics statistics = scores({1, 1, 0});
  tg::DensifySettings settings;
  settings.prune_large = true;
  tg::Random random(1);
  const tg::DensifyResult result = tg::densify(state, statistics, settings, random);
  CHECK(result.pruned == 2);
  CHECK(result.split == 1);
  REQUIRE(state.model.size() == 2);
  CHECK(state.model.log_scale[0].x == Approx(std::log(0.15f / 1.6f)));
}

TEST_CASE("under a cap the highest scores grow, and no more than fit", "[densify]") {
  tg::TrainingState state = rowOf(5);
  state.model.opacity_logit[4] = logit(0.001f);
  tg::DensityStatistics statistics = scores({3e-4f, 9e-4f, 5e-4f, 9e-4f, 1});
  tg::DensifySettings settings;
  settings.max_gaussians = 6;  // four survive: room for two
  tg::Random random(1);
  tg::densify(state, statistics, settings, random);
  CHECK(positions(state) == std::vector<float>{0, 1, 2, 3, 1, 3});
  statistics = scores({1, 1, 1, 1, 1, 1});
  tg::densify(state, statistics, settings, random);
  CHECK(state.model.size() == 6);
  settings.max_gaussians = 2;  // already above: nothing grows, nothing is thrown away
  statistics = scores({1, 1, 1, 1, 1, 1});
  tg::densify(state, statistics, settings, random);
  CHECK(state.model.size() == 6);
}

TEST_CASE("by magnitudes, as many again grow whose pixels pull hard in opposite directions", "[densify]") {
  tg::TrainingState state = rowOf(5);
  tg::DensityStatistics statistics = scores({3e-4f, 1e-4f, 1e-4f, 5e-4f, 0});
  statistics.magnitude_sum = {2, 8, 30, 20, 10};  // two pass the threshold: the two largest magnitudes are 2 and 3
  tg::DensifySettings settings;
  settings.score = tg::DensifyScore::magnitudes;
  tg::Random random(1);
  tg::TrainingState alone = state;
  tg::DensityStatistics copy = statistics;
  tg::densify(state, statistics, settings, random);
  CHECK(positions(state) == std::vector<float>{0, 1, 2, 3, 4, 0, 2, 3});
  settings.score = tg::DensifyScore::magnitudesOnly;  // as many as pass, and others
  tg::densify(alone, copy, settings, random);
  CHECK(positions(alone) == std::vector<float>{0, 1, 2, 3, 4, 2, 3});

  SECTION("one that passes is enough") {
    tg::TrainingState one = rowOf(3);
    statistics = scores({3e-4f, 1e-4f, 1e-4f});
    statistics.magnitude_sum = {2, 8, 30};
    tg::densify(one, statistics, settings, random);
    CHECK(positions(one) == std::vector<float>{0, 1, 2, 2});
  }

  SECTION("nothing grows by magnitude alone") {
    tg::TrainingState quiet = rowOf(3);
    statistics = scores({1e-4f, 1e-4f, 1e-4f});
    statistics.magnitude_sum = {2, 8, 30};
    tg::densify(quiet, statistics, settings, random);
    CHECK(quiet.model.size() == 3);
  }
}

TEST_CASE("scores are means over the views that saw the Gaussian", "[densify]") {
  tg::DensityStatistics statistics;
  statistics.reset(2);
  tg::ModelGradient gradient;
  gradient.screen_gradient = {0.5f, 0.25f};
  gradient.screen_gradient_abs = {2, 1};
  gradient.screen_radius = {4, 0};
  statistics.add(gradient);
  gradient.screen_gradient = {0.25f, 0.125f};
  gradient.screen_radius = {9, 2};
  statistics.add(gradient);
  CHECK(statistics.score_sum == std::vector<float>{0.75f, 0.125f});
  CHECK(statistics.magnitude_sum == std::vector<float>{4, 1});
  CHECK(statistics.view_count == std::vector<std::uint32_t>{2, 1});
  CHECK(statistics.max_radius == std::vector<float>{9, 2});
}

TEST_CASE("statistics begin with nothing seen", "[densify]") {
  tg::DensityStatistics statistics = scores({1, 2, 3});
  statistics.reset(2);
  CHECK(statistics.score_sum == std::vector<float>{0, 0});
  CHECK(statistics.magnitude_sum == std::vector<float>{0, 0});
  CHECK(statistics.view_count == std::vector<std::uint32_t>{0, 0});
  CHECK(statistics.max_radius == std::vector<float>{0, 0});
}

TEST_CASE("an opacity reset lowers and never raises", "[densify]") {
  tg::TrainingState state = rowOf(2);
  state.model.opacity_logit[1] = logit(0.006f);
  state.moments.opacity_logit.first = {1, 1};
  tg::resetOpacity(state);
  CHECK(state.model.opacity_logit[0] == Approx(logit(0.01f)));
  CHECK(state.model.opacity_logit[1] == Approx(logit(0.006f)));
  CHECK(state.moments.opacity_logit.first == std::vector<float>{0, 0});
}
