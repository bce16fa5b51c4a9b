#version 450
// SPDX-License-Identifier: Apache-2.0
// sort_scatter with one thread per partition. Stable, because a thread moves its items in order.
#extension GL_GOOGLE_include_directive : require
#include "fetch.glsl"
#include "pass.glsl"

layout(local_size_x = kRunThreads) in;
FETCHED_UINTS(0, KeysIn, keys_in);
FETCHED_UINTS(1, ValuesIn, values_in);
layout(std430, binding = 2) buffer CountersBlock { Counters counters; };
layout(std430, binding = 3) writeonly buffer KeysOut { uint keys_out[]; };
layout(std430, binding = 4) writeonly buffer ValuesOut { uint values_out[]; };
layout(std430, binding = 5) buffer Histogram { uint histogram[]; };  // [kDigitCount, kMaxPartitions]; becomes places
layout(std430, binding = 6) readonly buffer DigitTotals { uint digit_totals[]; };

void main() {
  uint part = gl_GlobalInvocationID.x;
  if (part >= counters.work[pass.work].partitions) return;
  uint begin = part * counters.work[pass.work].partition_items;
  uint end = min(begin + counters.work[pass.work].partition_items, counters.work[pass.work].count);
  uint before = 0u;
  for (uint digit = 0u; digit < kDigitCount; ++digit) {
    histogram[digit * kMaxPartitions + part] += before;
    before += digit_totals[digit];
  }
  for (uint i = begin; i < end; ++i) {
    uint key = FETCH_UINT(keys_in, i);
    uint slot = (key >> pass.shift & (kDigitCount - 1u)) * kMaxPartitions + part;
    uint place = histogram[slot];
    histogram[slot] = place + 1u;
    keys_out[place] = key;
    values_out[place] = FETCH_UINT(values_in, i);
  }
}
