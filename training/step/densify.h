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

// One round. Survivors come first and keep their moments; clones and the second child of each split follow, with zero
// moments; the first child of a split takes its parent's place. Statistics are reset to the new size.
DensifyResult densify(TrainingState& state, DensityStatistics& statistics, const DensifySettings& settings,
                      Random& random);

// Opacity to at most 0.01, its moments to zero: what the picture does not need stays low and is pruned.
void resetOpacity(TrainingState& state);

}  // namespace tg
