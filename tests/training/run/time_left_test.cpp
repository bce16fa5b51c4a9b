// SPDX-License-Identifier: Apache-2.0
// Predictions of runs whose costs are known.
#include "training/run/time_left.h"

#include <cmath>

#include "support/catch.h"

using namespace tg;

namespace {

// A step of so many Gaussians, with textures or without.
double costOf(std::size_t gaussians, double factor = 1) {
  return factor * 1e-4 * std::pow(static_cast<double>(gaussians), 0.7);
}

}  // namespace

TEST_CASE("time left is that of stages to come, with Gaussians and textures to come", "[time]") {
  TrainSettings settings;
  settings.iterations = 4000;
  settings.texture_iterations = 1000;
  const Schedule schedule = makeSchedule(settings);
  TimeLeft left(settings, schedule);
  left.beginStage(false, 16);
  RunPlan plan;
  plan.densifies = true;
  plan.texels = 16;
  plan.textured_left = settings.texture_iterations;
  CHECK(left.seconds(plan) == 0);
  const auto countAt = [&](int iteration) {
    const int rounds =
        std::clamp((std::min(iteration, schedule.densify_until - 1) - schedule.densify_from) / 100, 0, 100);
    return static_cast<std::size_t>(1000 + 700 * rounds);
  };
  const double factor = 2.2 + 0.25 * 4 * 16 / 59.0;
  double actual = 0;
  for (int i = 801; i <= 4000; ++i) actual += costOf(countAt(i - 1));
  actual += 1000 * costOf(countAt(4000), factor);
  for (int i = 1; i <= 800; ++i) left.add(costOf(countAt(i - 1)), countAt(i));
  plan.iteration = 800;
  plan.left = 3200;
  plan.gaussians = countAt(800);
  CHECK(left.seconds(plan) == Approx(actual).epsilon(0.1));
  // A limit that is reached ends the growth.
  plan.limit = countAt(800);
  CHECK(left.seconds(plan) < 0.7 * actual);
}

TEST_CASE("stage 2 begins with what is known of textures and goes on with what it measures", "[time]") {
  TrainSettings settings;
  settings.texture_iterations = 1000;
  TimeLeft left(settings, makeSchedule(settings));
  left.beginStage(false, 16);
  for (int i = 0; i < 500; ++i) left.add(0.01, 5000);
  left.beginStage(true, 16);
  RunPlan plan;
  plan.textured = true;
  plan.left = 1000;
  plan.gaussians = 5000;
  plan.texels = 16;
  const double known = left.seconds(plan);
  CHECK(known == Approx(10 * (2.2 + 64 / 59.0 / 4)).epsilon(0.01));
  // Twice as slow as expected: a hundred steps are enough to see it.
  for (int i = 0; i < 200; ++i) left.add(0.05, 5000);
  plan.left = 800;
  CHECK(left.seconds(plan) == Approx(40).epsilon(0.1));
  // The twin's steps have none of it.
  plan.left = 0;
  plan.untextured_left = 1000;
  CHECK(left.seconds(plan) < 25);
}
