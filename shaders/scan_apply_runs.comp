#version 450
// SPDX-License-Identifier: Apache-2.0
// scan_apply with one thread per partition.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"
#include "scan_runs.glsl"

layout(local_size_x = kRunThreads) in;
layout(std430, binding = 3) readonly buffer PartitionOffsets { uint partition_offsets[]; };
layout(std430, binding = 4) writeonly buffer Offsets { uvec4 offsets[]; };  // its size is a multiple of 16 bytes

void main() {
  uint part = gl_GlobalInvocationID.x;
  if (part >= counters.work[pass.work].partitions) return;
  uint begin = part * counters.work[pass.work].partition_items;
  uint end = min(begin + counters.work[pass.work].partition_items, counters.work[pass.work].count);
  uint sum = partition_offsets[part];
  for (uint quad = begin / 4u; quad * 4u < end; ++quad) {
    uvec4 inputs = scanInputs(quad, end);
    uvec4 before;
    before.x = sum;
    before.y = addSaturated(before.x, inputs.x);
    before.z = addSaturated(before.y, inputs.y);
    before.w = addSaturated(before.z, inputs.z);
    sum = addSaturated(before.w, inputs.w);
    offsets[quad] = before;
  }
}
