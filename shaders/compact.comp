#version 450
// SPDX-License-Identifier: Apache-2.0
// The visible splats side by side, in the model's order: what the depth sort sorts.
#extension GL_GOOGLE_include_directive : require
#include "fetch.glsl"
#include "pass.glsl"

layout(local_size_x = kGroupSize) in;
FETCHED_UVEC4S(0, Records, records);                                                // [N, 8] SplatRecord
layout(std430, binding = 1) buffer CountersBlock { Counters counters; };
layout(std430, binding = 2) readonly buffer TileCounts { uint tile_counts[]; };        // [N]
layout(std430, binding = 3) readonly buffer Offsets { uint offsets[]; };               // [N]
layout(std430, binding = 4) writeonly buffer Keys { uint keys[]; };                    // [visible]
layout(std430, binding = 5) writeonly buffer Splats { uint splats[]; };                // [visible]

void main() {
  uint i = itemIndex();
  if (i >= counters.work[kWorkGaussians].count || tile_counts[i] == 0u) return;
  keys[offsets[i]] = FETCH(records, i * kRecordSize).z;  // depth > kNear > 0: its bits sort like its value
  splats[offsets[i]] = i;
}
