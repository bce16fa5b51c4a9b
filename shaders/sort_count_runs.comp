#version 450
// SPDX-License-Identifier: Apache-2.0
// sort_count with one thread per partition: for drivers on the CPU, where a thread that walks alone is cheapest.
#extension GL_GOOGLE_include_directive : require
#include "fetch.glsl"
#include "pass.glsl"

layout(local_size_x = kRunThreads) in;
FETCHED_UINTS(0, Keys, keys);
layout(std430, binding = 1) buffer CountersBlock { Counters counters; };
layout(std430, binding = 2) buffer Histogram { uint histogram[]; };  // [kDigitCount, kMaxPartitions]

void main() {
  uint part = gl_GlobalInvocationID.x;
  if (part >= counters.work[pass.work].partitions) return;
  uint begin = part * counters.work[pass.work].partition_items;
  uint end = min(begin + counters.work[pass.work].partition_items, counters.work[pass.work].count);
  for (uint digit = 0u; digit < kDigitCount; ++digit) histogram[digit * kMaxPartitions + part] = 0u;
  for (uint i = begin; i < end; ++i) {
    ++histogram[(FETCH_UINT(keys, i) >> pass.shift & (kDigitCount - 1u)) * kMaxPartitions + part];
  }
}
