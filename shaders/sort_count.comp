#version 450
// SPDX-License-Identifier: Apache-2.0
// Radix sort, step 1 of 3: how often each digit occurs in each partition.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"

layout(local_size_x = kGroupSize) in;
layout(std430, binding = 0) buffer CountersBlock { Counters counters; };
layout(std430, binding = 1) readonly buffer Keys { uint keys[]; };
layout(std430, binding = 2) writeonly buffer Histogram { uint histogram[]; };  // [kDigitCount, kMaxPartitions]

shared uint digit_counts[kDigitCount];

void main() {
  uint thread = gl_LocalInvocationIndex;
  uint part = gl_WorkGroupID.x;
  uint begin = part * counters.work[pass.work].partition_items;
  uint end = min(begin + counters.work[pass.work].partition_items, counters.work[pass.work].count);
  digit_counts[thread] = 0u;
  barrier();
  for (uint i = begin + thread; i < end; i += kGroupSize) {
    atomicAdd(digit_counts[keys[i] >> pass.shift & (kDigitCount - 1u)], 1u);
  }
  barrier();
  histogram[thread * kMaxPartitions + part] = digit_counts[thread];
}
