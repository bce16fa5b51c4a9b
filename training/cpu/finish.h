// SPDX-License-Identifier: Apache-2.0
// From the sums of all its pixels to the gradient of a Gaussian's stored parameters.
#pragma once
#include <span>

#include "render/cpu/project.h"
#include "training/cpu/backward.h"
#include "training/step/gradient.h"

namespace tg::cpu {

// The sums of all pairs of a splat.
struct SplatSums {
  const Splat* splat;
  PairSums pairs;
  PairTextureSums texture;  // read if the view is textured
  float screen_abs;
};

constexpr int kMaxFinishBatch = 8;
int finishBatchSize();  // Gaussians that are worked on at once, at most kMaxFinishBatch

// Writes every entry of `gradient` that belongs to the splats' Gaussians, except texels and the screen radius. At most
// finishBatchSize() of them; the result does not depend on how they are grouped.
void finishSplats(const View& view, const GaussianModel& model, std::span<const SplatSums> splats,
                  ModelGradient& gradient);

}  // namespace tg::cpu
