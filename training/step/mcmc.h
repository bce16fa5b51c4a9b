// SPDX-License-Identifier: Apache-2.0
// Densification as Markov chain Monte Carlo (Kheradmand et al. 2024): Gaussians that died are moved onto live ones, the
// count grows to a cap, and noise explores where opacity is low.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "training/step/density_math.h"
#include "training/step/optimizer.h"
#include "core/system/random.h"

namespace tg {

// What a round does to the Gaussians; without sources it does nothing.
struct McmcPlan {
  std::vector<std::uint32_t> source;  // new Gaussian i is a copy of the old one source[i]
  std::vector<int> copies;            // [old Gaussians] how many share its place
  McmcResult result;
};
McmcPlan planRelocation(std::span<const float> opacity_logit, const McmcSettings& settings, Random& random);
// Gaussian i, one of `shared` at a place: its share of opacity and scale (9a, 9b), its moments anew. Nothing for one.
void shareGaussian(TrainingState& state, std::size_t i, int shared, const McmcSettings& settings);

// One round: every dead Gaussian goes where a live one is, drawn with probability proportional to opacity; then the
// count grows by `growth`, up to the cap, by the same draw. n Gaussians that end up at one place share its opacity and
// scale by docs/math.md (9a, 9b), so that the picture stays nearly the same. Their moments restart. Gaussians keep
// their order; new ones follow.
McmcResult relocateAndGrow(TrainingState& state, const McmcSettings& settings, Random& random);

// docs/math.md (9c) after a step, n drawn from (seed, iteration, index). strength: noise factor times the position
// rate. Same bytes for any thread count. first: index of the model's first Gaussian, where others have those before.
void addExplorationNoise(GaussianModel& model, float strength, std::uint64_t seed, int iteration,
                         std::uint64_t first = 0);

// Adds the gradients of weight * mean opacity and weight * mean sigma over `count` Gaussians, of which the model's are
// some, to `gradient`.
void addRegularizerGradient(const GaussianModel& model, float opacity_weight, float scale_weight, std::size_t count,
                            ModelGradient& gradient);
inline void addRegularizerGradient(const GaussianModel& model, float opacity_weight, float scale_weight,
                                   ModelGradient& gradient) {
  addRegularizerGradient(model, opacity_weight, scale_weight, model.size(), gradient);
}

}  // namespace tg
