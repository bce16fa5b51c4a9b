#version 450
// SPDX-License-Identifier: Apache-2.0
// Where each tile's splats begin and end in the sorted pairs. Tiles without pairs keep the zeros they were cleared to.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"

layout(local_size_x = kGroupSize) in;
layout(std430, binding = 0) buffer CountersBlock { Counters counters; };
layout(std430, binding = 1) readonly buffer Tiles { uint pair_tiles[]; };     // [pairs], ascending
layout(std430, binding = 2) writeonly buffer Ranges { uint tile_ranges[]; };  // [tiles, 2] begin, end

void main() {
  uint count = counters.work[kWorkPairs].count;
  uint pair = itemIndex();
  if (pair >= count) return;
  uint tile = pair_tiles[pair];
  if (pair == 0u || pair_tiles[pair - 1u] != tile) tile_ranges[2u * tile] = pair;
  if (pair + 1u == count || pair_tiles[pair + 1u] != tile) tile_ranges[2u * tile + 1u] = pair + 1u;
}
