#version 450
// SPDX-License-Identifier: Apache-2.0
// Prefix sum, step 1 of 3: the sum of every partition.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"
#include "group_scan.glsl"
#include "scan_input.glsl"

layout(local_size_x = kGroupSize) in;
layout(std430, binding = 3) writeonly buffer PartitionSums { uint partition_sums[]; };

void main() {
  uint part = gl_WorkGroupID.x;
  uint begin = part * counters.work[pass.work].partition_items;
  uint end = min(begin + counters.work[pass.work].partition_items, counters.work[pass.work].count);
  uint sum = 0u;
  for (uint i = begin + gl_LocalInvocationIndex; i < end; i += kGroupSize) sum = addSaturated(sum, scanInput(i));
  uint total;
  groupExclusiveScan(sum, total);
  if (gl_LocalInvocationIndex == 0u) partition_sums[part] = total;
}
