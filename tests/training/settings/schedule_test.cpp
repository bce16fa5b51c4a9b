// SPDX-License-Identifier: Apache-2.0
// What happens at which iteration.
#include "training/settings/schedule.h"

#include <array>

#include "support/catch.h"

TEST_CASE("short schedules keep the shape of long ones") {
  const auto schedule = [](int iterations) {
    tg::TrainSettings settings;
    settings.iterations = iterations;
    return tg::makeSchedule(settings);
  };
  const tg::Schedule paper = schedule(30000);
  CHECK(paper.sh_every == 1000);
  CHECK_FALSE(paper.densifies(500));
  CHECK(paper.densifies(600));
  CHECK(paper.densifies(14900));
  CHECK_FALSE(paper.densifies(15000));
  CHECK(paper.resetsOpacity(3000));
  CHECK(paper.resetsOpacity(12000));
  CHECK_FALSE(paper.resetsOpacity(15000));
  CHECK_FALSE(schedule(6201).resetsOpacity(3000));
  CHECK(schedule(6202).resetsOpacity(3000));
  for (const int iterations : {6002, 6100, 6201, 7000, 12002, 12201, 30000}) {
    const tg::Schedule s = schedule(iterations);
    for (int i = 1; i <= iterations; ++i) {
      if (s.resetsOpacity(i)) CHECK(s.densifies(i + s.densify_every));
    }
  }
  CHECK(paper.prunesLarge(3100));
  const tg::Schedule quick = schedule(2000);
  CHECK(quick.densifies(300));
  CHECK(quick.densifies(900));
  CHECK_FALSE(quick.densifies(1000));
  for (int i = 1; i <= 2000; ++i) CHECK_FALSE(quick.resetsOpacity(i));
  CHECK(schedule(1).raisesShDegree(1));
}

TEST_CASE("the shortest runs that densify are as long as the manual says") {
  const auto densifies = [](tg::Densification densification, int iterations) {
    tg::TrainSettings settings;
    settings.densification = densification;
    settings.iterations = iterations;
    const tg::Schedule schedule = tg::makeSchedule(settings);
    for (int i = 1; i <= iterations; ++i) {
      if (schedule.densifies(i)) return true;
    }
    return false;
  };
  CHECK_FALSE(densifies(tg::Densification::adc, 201));
  CHECK(densifies(tg::Densification::adc, 202));
  CHECK_FALSE(densifies(tg::Densification::mcmc, 120));
  CHECK(densifies(tg::Densification::mcmc, 121));
}

TEST_CASE("the last round is the last after which a run densifies") {
  for (const tg::Densification densification : {tg::Densification::none, tg::Densification::adc}) {
    for (const auto& [iterations, every, from, until] :
         {std::array{0, 100, -1, -1}, std::array{201, 100, -1, -1}, std::array{202, 100, -1, -1},
          std::array{300, 1, 0, 1}, std::array{300, 7, 250, -1}, std::array{300, 7, 0, 400},
          std::array{280, 7, 273, 400}, std::array{280, 7, 280, 400}, std::array{280, 1, -1, 0}}) {
      tg::TrainSettings settings;
      settings.densification = densification;
      settings.iterations = iterations;
      settings.densify_every = every;
      settings.densify_from = from;
      settings.densify_until = until;
      const tg::Schedule schedule = tg::makeSchedule(settings);
      int last = 0;
      for (int i = 1; i <= iterations; ++i) last = schedule.densifies(i) ? i : last;
      CHECK(schedule.lastRound(iterations) == last);
    }
  }
}

TEST_CASE("pairs are merged after the last round and before the end") {
  CHECK(tg::makeSchedule(tg::presetSettings("default")).merge_after == 4200);
  CHECK(tg::makeSchedule(tg::presetSettings("quick")).merge_after == 420);
  CHECK(tg::makeSchedule(tg::presetSettings("paper")).merge_after == 0);
  tg::TrainSettings settings;
  settings.densify_until = 6900;
  CHECK(tg::makeSchedule(settings).merge_after == 6950);
  settings.densify_until = GENERATE(0, 7000, 15000);
  CHECK(tg::makeSchedule(settings).merge_after == 0);
  settings.densify_until = -1;
  settings.densification = GENERATE(tg::Densification::none, tg::Densification::mcmc);
  CHECK(tg::makeSchedule(settings).merge_after == 0);
}
