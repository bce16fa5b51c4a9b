// SPDX-License-Identifier: Apache-2.0
// Gaussians to splats, splats to the lists of the tiles that they can colour.
#pragma once
#include "training/cuda/memory.h"
#include "training/cuda/types.h"

namespace tg::cuda {

// A frame's splats, by Gaussian.
struct ScreenSplats {
  Buffer<BlendSplat> splats;
  Buffer<LocalFrame> frames;          // empty without textures
  Buffer<std::uint32_t> pixel_rects;  // [N, 2] x0 | y0 << 16, x1 | y1 << 16, ends inclusive
  Buffer<std::uint32_t> tile_counts;  // [N] 0: not drawn
  Buffer<std::uint32_t> depth_keys;   // [N] bits of the mean's camera z; largest number: not drawn
  Buffer<float> screen_radius;        // [N] px, half the longer side of the unclipped screen box
  Buffer<glm::vec4> outlines;         // [N] as in SplatRecord
};
void projectGaussians(const View& view, const Parameters& model, ScreenSplats& out);

struct TileLists {
  Buffer<std::uint32_t> order;          // [N] Gaussians by depth, ties by index
  Buffer<std::uint32_t> pair_begin;     // [N] by Gaussian: its first pair
  Buffer<std::uint32_t> pair_gaussian;  // [room]
  Buffer<std::uint32_t> sorted_pairs;   // [room] those there are, then the rest of the room
  Buffer<std::uint32_t> tile_begin;     // [tiles + 1]
  Buffer<PairCount> pairs;              // [1] how many there are; above the room, the farthest splats' are missing
  std::size_t room = 0;

  Lists lists() const { return {sorted_pairs.data(), tile_begin.data(), pair_gaussian.data()}; }

  // [room, pairSums(...)] for the backward pass, which makes it as large as that; lists are built in it before, with
  // three numbers a pair.
  Buffer<float> sums;

  // [N] Scratch, free again when the lists are built.
  Buffer<std::uint32_t> sorted_keys, indices, counts, offsets;
};
// For that many pairs, not more.
void makeRoom(std::size_t pairs, TileLists& out);
// Waits for nothing: the device alone knows how many pairs there are. Sorts the whole room.
void buildLists(const View& view, const ScreenSplats& screen, Primitives& primitives, TileLists& out);

}  // namespace tg::cuda
