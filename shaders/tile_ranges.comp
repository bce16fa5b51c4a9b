#version 450
// SPDX-License-Identifier: Apache-2.0
// Where each tile's splats begin and end in the sorted pairs. Tiles without pairs keep the zeros they were cleared to.
#extension GL_GOOGLE_include_directive : require
#include "fetch.glsl"
#include "pass.glsl"

layout(local_size_x = kGroupSize) in;
FETCHED_UINTS(0, PairKeys, pair_keys);  // [pairs], ascending by tile
layout(std430, binding = 1) buffer CountersBlock { Counters counters; };
layout(std430, binding = 2) writeonly buffer Ranges { uint tile_ranges[]; };  // [tiles, 2] begin, end

uint tileOf(uint pair) { return FETCH_UINT(pair_keys, pair) >> kBlockBits; }

void main() {
  uint count = counters.work[kWorkPairs].count;
  uint pair = itemIndex();
  if (pair >= count) return;
  uint tile = tileOf(pair);
  if (pair == 0u || tileOf(pair - 1u) != tile) tile_ranges[2u * tile] = pair;
  if (pair + 1u == count || tileOf(pair + 1u) != tile) tile_ranges[2u * tile + 1u] = pair + 1u;
}
