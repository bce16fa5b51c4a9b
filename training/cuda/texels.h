// SPDX-License-Identifier: Apache-2.0
// Sums of the texels' gradients: 32 bytes a texel, so that of large models only those of a range of depths exist at a
// time. Where each Gaussian's lie, and from sums to gradients or to moved texels.
#pragma once
#include "training/cuda/blend.h"
#include "training/cuda/memory.h"
#include "training/cuda/project.h"
#include "training/cuda/step.h"
#include "training/cuda/types.h"

namespace tg::cuda {

// Gaussians in depth order, those that are not drawn behind the others, cut so that the first texels of a range's
// Gaussians lie among `texels`: a Gaussian's texels all belong to its range. Since tiles' lists are in depth order,
// too, a range is a part of each.
struct DepthRanges {
  std::size_t count = 1;
  std::size_t texels = 0;             // with sums at a time
  Buffer<std::uint32_t> ranks;        // [count + 1] the first in the order, then their number
  Buffer<std::uint32_t> pairs;        // [count + 1] the first pair
  Buffer<std::uint32_t> list_places;  // [count + 1, tiles] the first pair's place in a tile's list
  // [N] by Gaussian: where its first texel's sum lies. In the lists' scratch memory.
  std::uint32_t* texel_places = nullptr;
};
// As few as can be with at most so many texels a range, and those of one Gaussian. A single one covers all: it has no
// buffers, and sums lie as texels do in the atlas.
void cutRanges(const Parameters& model, std::size_t texels_at_a_time, std::size_t tiles, Primitives& primitives,
               TileLists& lists, DepthRanges& out);

// The sums of a range, 0 for what is not drawn; who takes them leaves zeros.
struct TexelSums {
  long long* sums;                   // [texels, 4] in kTexelUnits
  const std::uint32_t* tile_counts;  // [N] 0: not drawn
  // Null, all three, where there is one range.
  const std::uint32_t* order;   // [N] Gaussians by depth
  const std::uint32_t* ranks;   // [2] the range in it
  const std::uint32_t* places;  // [N] DepthRanges::texel_places
};

// Of a single range: to floats; where the stored alpha lies outside [0, 1], its gradient is 0.
void finishTexels(const TexelSums& sums, const Parameters& model, float* v_texels);

struct TexelMove {
  Parameters model;
  const DeviceMoments& moments;
  float rate;
  float decay;  // a step, as adamStep()
  AdamScales scales;
  bool clamp_colors;
  const std::uint32_t* stop = nullptr;
  // Where rectangles lie on one another, the Gaussians of those that are moved, each once: of a single range. Null:
  // all.
  const std::uint32_t* owners = nullptr;
  std::size_t owner_count = 0;
};
// Moves the texels of the range by Adam and lets them decay; then alpha to [0, 1], colours too where clamp_colors.
void moveTexels(const TexelSums& sums, const TexelMove& move);

}  // namespace tg::cuda
