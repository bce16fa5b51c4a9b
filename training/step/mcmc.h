// SPDX-License-Identifier: Apache-2.0
// Densification as Markov chain Monte Carlo (Kheradmand et al. 2024): Gaussians that died are moved onto live ones, the
// count grows to a cap, and noise explores where opacity is low.
#pragma once
#include <cstdint>

#include "training/step/density_math.h"
#include "training/step/optimizer.h"
#include "core/system/random.h"

namespace tg {

// One round: every dead Gaussian goes where a live one is, drawn with probability proportional to opacity; then the
// count grows by `growth`, up to the cap, by the same draw. n Gaussians that end up at one place share its opacity and
// scale by docs/math.md (9a, 9b), so that the picture stays nearly the same. Their moments restart. Gaussians keep
// their order; new ones follow.
McmcResult relocateAndGrow(TrainingState& state, const McmcSettings& settings, Random& random);

// docs/math.md (9c) after a step, n drawn from (seed, iteration, index). strength: noise factor times the position
// rate. Same bytes for any thread count.
void addExplorationNoise(GaussianModel& model, float strength, std::uint64_t seed, int iteration);

// Adds the gradients of weight * mean opacity and weight * mean sigma to `gradient`.
void addRegularizerGradient(const GaussianModel& model, float opacity_weight, float scale_weight,
                            ModelGradient& gradient);

}  // namespace tg
