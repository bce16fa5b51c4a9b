// SPDX-License-Identifier: Apache-2.0
// From the sums of a Gaussian's pairs to the gradient of its stored parameters.
#pragma once
#include "training/cuda/types.h"

namespace tg::cuda {

// A splat may have thousands of pairs, one a tile. If it has more than this, each run of so many of them, from its
// first pair on, is added up beforehand.
constexpr std::uint32_t kRun = 64;

struct RunInput {
  const std::uint32_t* gaussian;     // [pairs]
  const std::uint32_t* tile_counts;  // [N]
  const std::uint32_t* pair_begin;   // [N]
  const PairCount* pairs;            // [1]; above the room nothing is written
  std::size_t room;
  unsigned stride;      // pairSums(...)
  float* sums;          // [pairs, stride]
  std::uint8_t* shows;  // [pairs]
};
// Leaves the sum of each run at its first pair, in a fixed order of additions.
void addRuns(const RunInput& input);

struct FinishInput {
  View view;
  Parameters model;
  const BlendSplat* splats;
  const std::uint32_t* tile_counts;  // [N]
  const std::uint32_t* pair_begin;   // [N]
  const float* sums;                 // [pairs, pairSums(...)], after addRuns()
  const std::uint8_t* shows;         // [pairs]
  const PairCount* pairs;            // [1]; above the room nothing is written
  std::size_t room;
  bool statistics;
};

// Writes every entry of `gradient` but the texels', and the statistics, both [N] (ModelGradient).
void finishGradients(const FinishInput& input, const Parameters& gradient, float* screen_gradient,
                     float* screen_gradient_abs);

}  // namespace tg::cuda
