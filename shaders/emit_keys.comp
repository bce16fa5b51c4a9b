#version 450
// SPDX-License-Identifier: Apache-2.0
// One (tile, splat) pair per thread, in depth order of the splats: however many tiles a splat covers, a thread has one
// of them.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"

layout(local_size_x = kGroupSize) in;
layout(std430, binding = 0) buffer CountersBlock { Counters counters; };
layout(std430, binding = 1) readonly buffer Order { uint order[]; };            // [visible] splats, near to far
layout(std430, binding = 2) readonly buffer PairOffsets { uint offsets[]; };    // [visible] first pair of each
layout(std430, binding = 3) readonly buffer PixelRects { uvec2 pixel_rects[]; };  // [N] x0 | y0 << 16, x1 | y1 << 16
layout(std430, binding = 4) writeonly buffer Tiles { uint pair_tiles[]; };      // [pairs]
layout(std430, binding = 5) writeonly buffer Splats { uint pair_splats[]; };    // [pairs]

shared uvec2 group_entries;  // entries that own the first and the last pair of this group

// The last entry in [low, high] whose first pair is not after `pair`.
uint findEntry(uint pair, uint low, uint high) {
  while (low < high) {
    uint middle = low + (high - low + 1u) / 2u;
    if (offsets[middle] <= pair) {
      low = middle;
    } else {
      high = middle - 1u;
    }
  }
  return low;
}

void main() {
  uint count = counters.work[kWorkPairs].count;
  uint pair = itemIndex();
  uint group_begin = pair - gl_LocalInvocationIndex;
  if (group_begin >= count) return;
  uint last_entry = counters.work[kWorkVisible].count - 1u;
  if (gl_LocalInvocationIndex < 2u) {
    uint bound = gl_LocalInvocationIndex == 0u ? group_begin : min(group_begin + kGroupSize, count) - 1u;
    group_entries[gl_LocalInvocationIndex] = findEntry(bound, 0u, last_entry);
  }
  barrier();
  if (pair >= count) return;
  uint entry = findEntry(pair, group_entries.x, group_entries.y);
  uint splat = order[entry];
  uvec2 rect = pixel_rects[splat];
  uvec2 first = uvec2(rect.x & 0xFFFFu, rect.x >> 16u) / kTileSize;
  uint columns = (rect.y & 0xFFFFu) / kTileSize - first.x + 1u;
  uint k = pair - offsets[entry];
  pair_tiles[pair] = (first.y + k / columns) * view.tiles_x + first.x + k % columns;
  pair_splats[pair] = splat;
}
