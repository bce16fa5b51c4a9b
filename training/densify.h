// SPDX-License-Identifier: Apache-2.0
// Adaptive density control of 3DGS: clone, split and prune, under an optional cap on the number of Gaussians.
#pragma once
#include <cstdint>
#include <vector>

#include "training/optimizer.h"
#include "training/random.h"

namespace tg {

// Gathered over the views since the last densification.
struct DensityStatistics {
  std::vector<float> score_sum;           // [N] sum of screen_gradient
  std::vector<float> magnitude_sum;       // [N] sum of screen_gradient_abs
  std::vector<std::uint32_t> view_count;  // [N] views that saw the Gaussian
  std::vector<float> max_radius;          // [N] px

  void reset(std::size_t count);
  void add(const ModelGradient& gradient);
};

struct DensifySettings {
  double extent = 1;              // [world units] cameraExtent()
  float score_threshold = 2e-4f;  // NDC gradient, mean over the views
  // Also densify by the mean of magnitude_sum: as many Gaussians as pass the threshold, those with the largest
  // (the quantile rule of Gaussian Opacity Fields, Yu et al. 2024).
  bool magnitudes = false;
  float clone_max_scale = 0.01f;  // of the extent: smaller Gaussians are cloned, larger ones split
  float split_shrink = 1.6f;      // children of a split are this much smaller
  float prune_opacity = 0.005f;
  bool prune_large = false;       // also those wider than the next two allow
  float prune_scale = 0.1f;       // of the extent
  float prune_radius = 20;        // [px] on screen
  std::size_t max_gaussians = 0;  // 0: no limit. Under one, the highest scores grow first
};

struct DensifyResult {
  std::size_t pruned = 0;
  std::size_t cloned = 0;
  std::size_t split = 0;
};

// One round. Survivors come first and keep their moments; clones and the second child of each split follow, with zero
// moments; the first child of a split takes its parent's place. Statistics are reset to the new size.
DensifyResult densify(TrainingState& state, DensityStatistics& statistics, const DensifySettings& settings,
                      Random& random);

// Opacity to at most 0.01, its moments to zero: what the picture does not need stays low and is pruned.
void resetOpacity(TrainingState& state);

}  // namespace tg
