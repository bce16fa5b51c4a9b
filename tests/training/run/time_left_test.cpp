// SPDX-License-Identifier: Apache-2.0
// Predictions of runs whose costs are known.
#include "training/run/time_left.h"

#include <algorithm>

#include "support/catch.h"

using namespace tg;

namespace {

constexpr double kPixels = 160 * 160;

// A step of so many Gaussians with SH of this degree, with textures or without: about as fox at 120 x 213.
double costOf(std::size_t gaussians, int degree, double factor = 1) {
  const double sh = 1 + 0.03 * ((degree + 1) * (degree + 1) - 1);
  return factor * 1e-6 * (5000 + 0.45 * sh * static_cast<double>(gaussians));
}
// Of stage 1, whose SH grow.
int degreeAt(const Schedule& schedule, int iteration) { return std::min(iteration / schedule.sh_every, 3); }

// How many there were in a run of 3,000 iterations of it, from round to round.
constexpr std::size_t kCounts[] = {1999, 3080, 5094, 8498, 13514, 20352, 28941, 38856, 49188, 59941, 70408, 80735};

}  // namespace

TEST_CASE("time left is that of stages to come, with Gaussians and textures to come", "[time]") {
  TrainSettings settings;
  settings.iterations = 3000;
  settings.texture_iterations = 1000;
  const Schedule schedule = makeSchedule(settings);
  TimeLeft left(settings, schedule, kPixels);
  RunPlan plan;
  plan.densifies = plan.grows_sh = true;
  plan.texels = 16;
  plan.textured_left = settings.texture_iterations;
  plan.gaussians = kCounts[0];
  left.beginStage(plan);
  CHECK(left.seconds(plan) == 0);
  const auto countAt = [&](int iteration) {
    const int last = std::min(iteration, schedule.densify_until - 1);
    return kCounts[std::max(last / 100 - schedule.densify_from / 100, 0)];
  };
  double actual = 0;
  for (int i = 601; i <= 3000; ++i) actual += costOf(countAt(i - 1), degreeAt(schedule, i));
  // Of printshop at 100 px, 93,000 Gaussians: 1.85.
  actual += 1000 * costOf(countAt(3000), 3, 1.9);
  for (int i = 1; i <= 600; ++i) left.add(costOf(countAt(i - 1), degreeAt(schedule, i)), countAt(i));
  plan.iteration = 600;
  plan.left = 2400;
  plan.gaussians = countAt(600);
  CHECK(left.seconds(plan) == Approx(actual).epsilon(0.2));
  // A limit that is reached ends the growth.
  plan.limit = countAt(600);
  const double limited = left.seconds(plan);
  CHECK(limited < 0.7 * actual);
  // So does merging, after which the rest of stage 1 and stage 2 have fewer.
  plan.merge_after = 1800;
  plan.merged = countAt(600) / 4;
  CHECK(left.seconds(plan) < 0.85 * limited);
  plan.limit = 0;
  CHECK(left.seconds(plan) < 0.7 * actual);
}

TEST_CASE("a stage 1 of a share takes longer where pairs are merged down to it", "[time]") {
  TrainSettings settings;
  settings.iterations = 1000;
  settings.sh_degree = 0;
  const Schedule schedule = makeSchedule(settings);
  TimeLeft left(settings, schedule, 10'000);
  RunPlan plan;
  plan.gaussians = 5000;
  left.beginStage(plan);
  for (int i = 0; i < 500; ++i) left.add(0.01, 5000);
  plan.first_left = 1000;
  plan.first_share = 0.1;
  const double swapped = left.seconds(plan);
  const auto steps = [](int count, double gaussians) { return count * 0.01 * (gaussians + 5000) / (5000 + 5000); };
  CHECK(swapped == Approx(steps(1000, 500)).epsilon(0.01));
  plan.first_pixels = 10'000'000;
  REQUIRE(schedule.merge_after == 600);
  CHECK(left.seconds(plan) == Approx(steps(600, 2000) + steps(400, 500)).epsilon(0.01));
}

TEST_CASE("stage 2 begins with what is known of textures and goes on with what it measures", "[time]") {
  TrainSettings settings;
  settings.texture_iterations = 1000;
  settings.densification = Densification::none;
  settings.sh_degree = 0;
  TimeLeft left(settings, makeSchedule(settings), 10'000);
  RunPlan plan;
  left.beginStage(plan);
  for (int i = 0; i < 500; ++i) left.add(0.01, 5000);
  plan.textured = true;
  plan.left = 1000;
  plan.gaussians = 5000;
  plan.texels = 16;
  left.beginStage(plan);
  const double known = left.seconds(plan);
  CHECK(known == Approx(10 * ((5000 * (1 + 0.016 * 64) + 3.5 * 0.5 * 10'000) / (5000 + 0.5 * 10'000))).epsilon(0.01));
  // Twice as slow as expected: a hundred steps are enough to see it.
  for (int i = 0; i < 200; ++i) left.add(0.05, 5000);
  plan.left = 800;
  CHECK(left.seconds(plan) == Approx(40).epsilon(0.1));
  // One that waits for a disk says nothing of the others.
  const double before = left.seconds(plan);
  left.add(5, 5000);
  CHECK(left.seconds(plan) == Approx(before).epsilon(0.03));
  // The twin's steps have none of it.
  plan.left = 0;
  plan.untextured_left = 1000;
  CHECK(left.seconds(plan) < 25);
}
