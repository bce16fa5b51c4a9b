// SPDX-License-Identifier: Apache-2.0
// Tiles of splats to pixels, and from dL/d(picture) back to sums per (tile, splat) pair and to texels.
#pragma once
#include "training/cuda/memory.h"
#include "training/cuda/types.h"
#include "training/gradient.h"

namespace tg::cuda {

struct BlendInput {
  View view;
  const BlendSplat* splats;
  const LocalFrame* frames;
  const float* texels;
  Lists lists;
};

// What backward takes from forward, per pixel of the image.
struct PixelRecord {
  float* transmittance;  // what is left behind the last blended splat
  std::uint32_t* end;    // one past the last blended splat's place in the tile's list
};

// picture: [height, width, 3].
void blendForward(const BlendInput& input, const PixelRecord& record, float* picture);

struct PairGradients {
  float* sums;          // [pairs, pairSums(...)]
  std::uint8_t* shows;  // [pairs], zeros before; 1: the pair's sums hold
  long long* v_texels;  // [texels, 4] in kTexelUnits, added to
};
void blendBackward(const BlendInput& input, const PixelRecord& record, const float* v_picture,
                   const GradientOptions& options, const PairGradients& out);

}  // namespace tg::cuda
