#version 450
// SPDX-License-Identifier: Apache-2.0
// scan_reduce with one thread per partition: for drivers on the CPU, where a thread that walks alone is cheapest.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"
#include "scan_runs.glsl"

layout(local_size_x = kRunThreads) in;
layout(std430, binding = 3) writeonly buffer PartitionSums { uint partition_sums[]; };

void main() {
  uint part = gl_GlobalInvocationID.x;
  if (part >= counters.work[pass.work].partitions) return;
  uint begin = part * counters.work[pass.work].partition_items;
  uint end = min(begin + counters.work[pass.work].partition_items, counters.work[pass.work].count);
  uint sum = 0u;
  for (uint quad = begin / 4u; quad * 4u < end; ++quad) {
    uvec4 inputs = scanInputs(quad, end);
    sum = addSaturated(addSaturated(addSaturated(addSaturated(sum, inputs.x), inputs.y), inputs.z), inputs.w);
  }
  partition_sums[part] = sum;
}
