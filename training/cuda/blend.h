// SPDX-License-Identifier: Apache-2.0
// Tiles of splats to pixels, and from dL/d(picture) back to sums per (tile, splat) pair and to texels.
#pragma once
#include "training/cuda/memory.h"
#include "training/cuda/types.h"
#include "training/step/gradient.h"

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
  // [N] by Gaussian: where its first texel lies in v_texels; null: where it lies in the atlas.
  const std::uint32_t* texel_places;
};

// A part of every tile's list. Passes over the parts of a list, the farthest first, are together one over all of it:
// what a pixel knows of the parts behind waits in `along` and in its record's transmittance.
struct ListPart {
  const std::uint32_t* begin = nullptr;  // [tiles] places in a tile's list, from its first; null: from there
  const std::uint32_t* end = nullptr;    // [tiles]; null: to its last
  float* along = nullptr;                // [height, width]; null: nothing waits
  bool farthest = true;
};
void blendBackward(const BlendInput& input, const PixelRecord& record, const float* v_picture,
                   const GradientOptions& options, const ListPart& part, const PairGradients& out);

}  // namespace tg::cuda
