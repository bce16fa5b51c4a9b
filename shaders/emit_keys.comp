#version 450
// SPDX-License-Identifier: Apache-2.0
// The (tile, splat) pairs in depth order of the splats: however many tiles a splat covers, a thread has as many pairs
// as any other. A pair's key holds the tile and, below it, the blocks of the tile that the splat touches.
#extension GL_GOOGLE_include_directive : require
#include "fetch.glsl"
#include "pass.glsl"
#include "shared/record.h"

layout(local_size_x = kGroupSize) in;
// One pair per thread of Work::item_groups, or a run of pairs per thread of Work::partition_groups: fewer searches.
layout(constant_id = 0) const bool kRuns = false;
FETCHED_UVEC4S(0, Records, records);  // [N, 8] SplatRecord
layout(std430, binding = 1) buffer CountersBlock { Counters counters; };
layout(std430, binding = 2) readonly buffer Order { uint order[]; };              // [visible] splats, near to far
layout(std430, binding = 3) readonly buffer PairOffsets { uint offsets[]; };      // [visible] first pair of each
layout(std430, binding = 4) readonly buffer PixelRects { uvec2 pixel_rects[]; };  // [N] x0 | y0 << 16, x1 | y1 << 16
layout(std430, binding = 5) writeonly buffer Keys { uint pair_keys[]; };          // [pairs]
layout(std430, binding = 6) writeonly buffer Splats { uint pair_splats[]; };      // [pairs]

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

vec4 fetchRecord(uint splat, uint member) {
  return uintBitsToFloat(FETCH(records, splat * kRecordSize + member));
}

void main() {
  uint thread = gl_LocalInvocationIndex;
  uint count = counters.work[kWorkPairs].count;
  uint group_pairs = kRuns ? counters.work[kWorkPairs].partition_items : kGroupSize;
  uint group_begin = itemIndex() / kGroupSize * group_pairs;
  if (group_begin >= count) return;
  uint last_entry = counters.work[kWorkVisible].count - 1u;
  if (thread < 2u) {
    uint bound = thread == 0u ? group_begin : min(group_begin + group_pairs, count) - 1u;
    group_entries[thread] = findEntry(bound, 0u, last_entry);
  }
  barrier();
  uint run = group_pairs / kGroupSize;
  uint pair = group_begin + thread * run;
  uint end = min(pair + run, count);
  if (pair >= end) return;
  uint entry = findEntry(pair, group_entries.x, group_entries.y);
  uint skip = pair - offsets[entry];  // tiles of the first splat that belong to earlier threads
  uint splat_end = pair;              // the pair after the splat's last
  uint splat = 0u;
  uvec4 rect = uvec4(0u);
  SplatRecord record;
  uint row = 0u;
  uint row_end = 0u;
  uint column = 0u;
  uint column_end = 0u;
  uint tile = 0u;
  for (; pair < end; ++pair) {
    while (pair == splat_end) {  // the next splat
      splat = order[entry];
      splat_end = entry < last_entry ? offsets[entry + 1u] : count;
      uvec2 ends = pixel_rects[splat];
      rect = uvec4(ends.x & 0xFFFFu, ends.x >> 16u, ends.y & 0xFFFFu, ends.y >> 16u);
      record.center_depth_opacity = fetchRecord(splat, 0u);
      record.w_r = fetchRecord(splat, 1u);
      record.d_g = fetchRecord(splat, 2u);
      record.e_b = fetchRecord(splat, 3u);
      record.outline = fetchRecord(splat, 7u);
      row = rect.y / kTileSize;
      row_end = rect.w / kTileSize + 1u;
      column = 0u;
      column_end = 0u;
      ++entry;
    }
    while (column == column_end && row < row_end) {  // the next row of tiles
      uint tiles = splatTiles(record, rect, row, column);
      column_end = column + tiles;
      uint skipped = min(skip, tiles);
      column += skipped;
      skip -= skipped;
      ++row;
    }
    uint blocks = 0u;
    if (column < column_end) {
      tile = (row - 1u) * view.tiles_x + column;
      blocks = splatBlocks(record, column, row - 1u);
      ++column;
    }
    pair_keys[pair] = tile << kBlockBits | blocks;
    pair_splats[pair] = splat;
  }
}
