#version 450
// SPDX-License-Identifier: Apache-2.0
// Prefix sum, step 2 of 3: sums of partitions become offsets of partitions, in one group; the grand total becomes the
// work of the passes that follow.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"
#include "group_scan.glsl"

layout(local_size_x = kGroupSize) in;
layout(std430, binding = 0) buffer CountersBlock { Counters counters; };
layout(std430, binding = 1) buffer PartitionSums { uint partition_sums[]; };

void main() {
  const uint per_thread = kMaxPartitions / kGroupSize;
  uint partitions = counters.work[pass.work].partitions;
  uint first = gl_LocalInvocationIndex * per_thread;
  uint sums[per_thread];
  uint sum = 0u;
  for (uint k = 0u; k < per_thread; ++k) {
    sums[k] = first + k < partitions ? partition_sums[first + k] : 0u;
    sum = addSaturated(sum, sums[k]);
  }
  uint total;
  uint offset = groupExclusiveScan(sum, total);
  for (uint k = 0u; k < per_thread; ++k) {
    if (first + k < partitions) partition_sums[first + k] = offset;
    offset = addSaturated(offset, sums[k]);
  }
  if (gl_LocalInvocationIndex == 0u) counters.work[pass.next_work] = makeWork(total, pass.capacity);
}
