// SPDX-License-Identifier: Apache-2.0
// Adaptive density control of 3DGS: clone, split and prune, under an optional cap on the number of Gaussians.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/system/random.h"
#include "training/step/density_math.h"
#include "training/step/optimizer.h"

namespace tg {

// Gathered over the views since the last densification.
struct DensityStatistics {
  std::vector<float> score_sum;           // [N] sum of screen_gradient
  std::vector<float> magnitude_sum;       // [N] sum of screen_gradient_abs
  std::vector<std::uint32_t> view_count;  // [N] views that saw the Gaussian
  std::vector<float> max_radius;          // [N] px

  void reset(std::size_t count);
  void select(std::span<const std::uint32_t> kept);
  void grow(std::size_t count);  // nothing is known of those that come
  void add(const ModelGradient& gradient);
};

// What a round does to the Gaussians.
struct DensifyPlan {
  struct Child {
    std::size_t index;  // in the new model
    glm::vec3 mean;
    glm::vec3 log_scale;
  };
  std::vector<std::uint32_t> source;  // new Gaussian i is a copy of the old one source[i]
  std::size_t kept = 0;               // the first so many keep their moments
  std::vector<Child> children;        // of splits: they get a mean and a scale of their own
  std::vector<std::size_t> fresh;     // survivors' places taken by a child: their moments restart
  DensifyResult result;
};
// Of `model` it reads mean, rotation, log_scale and opacity_logit alone.
DensifyPlan planDensification(const GaussianModel& model, const DensityStatistics& statistics,
                              const DensifySettings& settings, Random& random);

// One round. Survivors come first and keep their moments; clones and the second child of each split follow, with zero
// moments; the first child of a split takes its parent's place. Statistics are reset to the new size.
DensifyResult densify(TrainingState& state, DensityStatistics& statistics, const DensifySettings& settings,
                      Random& random);

// Opacity to at most 0.01, its moments to zero: what the picture does not need stays low and is pruned.
void resetOpacity(TrainingState& state);

}  // namespace tg
