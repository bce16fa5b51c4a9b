#version 450
// SPDX-License-Identifier: Apache-2.0
// Prefix sum, step 3 of 3: the sum of all items before each item.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"
#include "group_scan.glsl"
#include "scan_input.glsl"

layout(local_size_x = kGroupSize) in;
layout(std430, binding = 3) readonly buffer PartitionOffsets { uint partition_offsets[]; };
layout(std430, binding = 4) writeonly buffer Offsets { uint offsets[]; };

const uint kPerThread = kPartitionStep / kGroupSize;

void main() {
  uint part = gl_WorkGroupID.x;
  uint begin = part * counters.work[pass.work].partition_items;
  uint end = min(begin + counters.work[pass.work].partition_items, counters.work[pass.work].count);
  uint base = partition_offsets[part];
  for (uint step_begin = begin; step_begin < end; step_begin += kPartitionStep) {
    uint first = step_begin + gl_LocalInvocationIndex * kPerThread;
    uint inputs[kPerThread];
    uint sum = 0u;
    for (uint k = 0u; k < kPerThread; ++k) {
      inputs[k] = first + k < end ? scanInput(first + k) : 0u;
      sum = addSaturated(sum, inputs[k]);
    }
    uint total;
    uint offset = addSaturated(base, groupExclusiveScan(sum, total));
    for (uint k = 0u; k < kPerThread; ++k) {
      if (first + k < end) offsets[first + k] = offset;
      offset = addSaturated(offset, inputs[k]);
    }
    base = addSaturated(base, total);
  }
}
