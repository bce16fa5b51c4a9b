// SPDX-License-Identifier: Apache-2.0
// When stage 1 does what. 3DGS plans for 30,000 iterations; shorter runs keep its shape.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "core/system/assert.h"
#include "training/settings/settings.h"

namespace tg {

// Iterations count from 1; an event at n happens after step n.
struct Schedule {
  int sh_every = 1000;  // the SH degree rises by one
  int densify_every = 100;
  int densify_from = 500;  // exclusive
  int densify_until = 0;   // exclusive
  int reset_every = 0;     // opacity reset; 0: never
  int reset_until = 0;     // exclusive
  int merge_after = 0;     // what a limit has no room for is merged; 0: never

  bool densifies(int iteration) const {
    TG_ASSERT(iteration >= 1 && densify_every >= 1, "iterations count from 1");
    return iteration > densify_from && iteration < densify_until && iteration % densify_every == 0;
  }
  bool raisesShDegree(int iteration) const { return sh_every > 0 && iteration % sh_every == 0; }
  bool resetsOpacity(int iteration) const {
    return reset_every > 0 && iteration < reset_until && iteration % reset_every == 0;
  }
  // The last round of a stage 1 of so many iterations; 0: it has none.
  int lastRound(int iterations) const {
    const int last = (std::min(densify_until, iterations + 1) - 1) / densify_every * densify_every;
    return last > densify_from ? last : 0;
  }
  // Large Gaussians are pruned once resets have begun, as in 3DGS: before, everything is still large.
  bool prunesLarge(int iteration) const { return reset_every > 0 && iteration > reset_every; }
};

// So many Gaussians may be there until pairs are merged down to `limit`: four times as many, but no more than training
// views of so many pixels have something to say of, nor than a million, some 2 GB by planBlocks()' estimate: a limit
// may be there for the memory.
inline std::size_t grownLimit(std::size_t limit, std::uint64_t training_pixels) {
  constexpr std::uint64_t kMergedFrom = 4;    // limits
  constexpr std::uint64_t kGrownPixels = 32;  // a Gaussian
  constexpr std::uint64_t kMostGrown = 1'000'000;
  return std::max<std::uint64_t>(limit, std::min({kMergedFrom * limit, training_pixels / kGrownPixels, kMostGrown}));
}

// Where settings leave it open (-1): 3DGS's numbers from 4,000 iterations on; below, events move closer in proportion,
// but rounds of densification stay as far apart: each looks at views, which short runs have no time for.
// ADC ends at half time, MCMC after five sixths (Kheradmand et al.: 25,000 of 30,000). An opacity reset costs about a
// thousand iterations of quality: only ADC runs of 6,202 and more have any, and none after the last round or in the
// last third, which could not make up for it.
inline Schedule makeSchedule(const TrainSettings& settings) {
  const int iterations = settings.iterations;
  const auto pick = [](int setting, int automatic) { return setting >= 0 ? setting : automatic; };
  Schedule schedule;
  schedule.sh_every = pick(settings.sh_every, std::clamp(iterations / 4, 1, 1000));
  schedule.densify_every = settings.densify_every;
  schedule.densify_from = pick(settings.densify_from, std::min(500, iterations / 8));
  switch (settings.densification) {
    case Densification::none:
      schedule.densify_until = 0;
      break;
    case Densification::adc:
      schedule.densify_until = pick(settings.densify_until, iterations / 2);
      break;
    case Densification::mcmc:
      schedule.densify_until = pick(settings.densify_until, iterations - iterations / 6);
      break;
  }
  const DensificationTraits traits = traitsOf(settings.densification);
  schedule.reset_every = traits.resets_opacity ? pick(settings.reset_every, iterations >= 6000 ? 3000 : 0) : 0;
  schedule.reset_until = std::min(schedule.densify_until - schedule.densify_every, iterations - iterations / 3);
  // Some time after the last round, for what it has brought to settle, and before the end, for what is merged. Where
  // rounds go on to the end a limit swaps.
  const int until = schedule.densify_until, after = iterations - until;
  if (traits.heeds_limit_by && until > 0 && after > 0) {
    switch (settings.limit_by) {
      case LimitBy::room:
      case LimitBy::swap:
        break;
      case LimitBy::merge:
        schedule.merge_after = until + std::min(until / 5, after / 2);
        break;
    }
  }
  return schedule;
}

}  // namespace tg
