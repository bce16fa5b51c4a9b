// SPDX-License-Identifier: Apache-2.0
// Which Gaussians and texels a limit keeps, and which Gaussians are too wide to stay one.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/merge/decimate.h"
#include "core/model/texture_budget.h"
#include "core/model/views.h"
#include "core/model/wide_splats.h"
#include "training/run/trainer.h"
#include "training/step/update.h"

namespace tg {

// Of the state's model as steps draw it, from an even choice of the training views.
std::vector<double> Trainer::seenWeights() {
  EffectiveParameters effective;
  const DrawnModel drawn(state_.training.model, effective, state_.min_sigma);
  return renderer_.seenWeights(state_.training.model, evenly(trainingViews(dataset_), seen_views_));
}

// The new texels' moments start at zero, and all others with them: their first steps are larger, to settle into.
void Trainer::cutTextures() {
  pull();
  engine_->stateChanged();
  const double texels = std::ceil(double{settings_.adaptive_texels} * static_cast<double>(engine_->gaussians(state_)));
  fitTexturesToBudget(state_.training.model, static_cast<std::uint64_t>(texels), seenWeights());
  resetMoments(state_.training);
  time_left_.rescale(texelsEach(), engine_->gaussians(state_));
}

// What has been merged starts with new moments, and all others with it: their first steps are larger, to settle into.
void Trainer::mergePairs() {
  if (engine_->gaussians(state_) <= limit()) return;
  pull();
  engine_->stateChanged();
  GaussianModel& model = state_.training.model;
  decimateByMerging(model, limit(), seenWeights());
  resetMoments(state_.training);
  state_.statistics.reset(model.size());
  updateFilter();
}

// Leaves as many Gaussians, those that the training views show most, with their statistics.
void Trainer::keepMostSeen(std::size_t count) {
  if (engine_->gaussians(state_) <= count) return;
  pull();
  engine_->stateChanged();
  const std::vector<double> weights = seenWeights();
  std::vector<std::uint32_t> kept(weights.size());
  std::iota(kept.begin(), kept.end(), 0u);
  std::nth_element(
      kept.begin(), kept.begin() + static_cast<std::ptrdiff_t>(count), kept.end(),
      [&](std::uint32_t a, std::uint32_t b) { return std::pair(-weights[a], a) < std::pair(-weights[b], b); });
  kept.resize(count);
  std::sort(kept.begin(), kept.end());
  selectGaussians(state_.training, kept, count);
  state_.statistics.select(kept);
  updateFilter();
}

void Trainer::splitWideOnes() {
  const std::size_t count = engine_->gaussians(state_);
  std::vector<glm::dvec3> eyes;
  for (const Pinhole& camera : filter_cameras_) eyes.push_back(camera.position());
  WideLimits limits{.bound = static_cast<double>(settings_.wide_sigma), .rounds = 1};
  const std::size_t most = limitNow();
  if (most > 0) limits.most_pieces = count < most ? (most - count) * 3 / 2 : 0;  // three in the place of one
  if (limits.most_pieces < 3 || !engine_->mayHaveWide(state_, eyes, limits.bound)) return;
  pull();
  TrainingState& training = state_.training;
  const WidePieces split = splitWide(training.model, eyes, limits);
  if (split.wide.empty()) return;
  engine_->stateChanged();
  std::vector<std::uint32_t> source;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (!std::ranges::binary_search(split.wide, i)) source.push_back(i);
  }
  state_.statistics.select(source);
  const std::size_t kept = source.size();
  source.insert(source.end(), split.source.begin(), split.source.end());
  selectGaussians(training, source, kept);
  std::ranges::copy(split.pieces.mean, training.model.mean.begin() + static_cast<std::ptrdiff_t>(kept));
  std::ranges::copy(split.pieces.log_scale, training.model.log_scale.begin() + static_cast<std::ptrdiff_t>(kept));
  std::ranges::copy(split.pieces.opacity_logit,
                    training.model.opacity_logit.begin() + static_cast<std::ptrdiff_t>(kept));
  state_.statistics.grow(training.model.size());
  updateFilter();
}

}  // namespace tg
