#version 450
// SPDX-License-Identifier: Apache-2.0
// Radix sort, step 2 of 3: for each digit, how often it occurs in the partitions before each partition, and in all.
// A group does 16 digits, 16 threads to a digit.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"

const uint kThreadsPerDigit = 16u;
const uint kDigitsPerGroup = kGroupSize / kThreadsPerDigit;
layout(local_size_x = kGroupSize) in;
layout(std430, binding = 0) buffer CountersBlock { Counters counters; };
layout(std430, binding = 1) buffer Histogram { uint histogram[]; };  // [kDigitCount, kMaxPartitions]
layout(std430, binding = 2) writeonly buffer DigitTotals { uint digit_totals[]; };

shared uint sums[kGroupSize];

void main() {
  uint thread = gl_LocalInvocationIndex;
  uint lane = thread % kThreadsPerDigit;
  uint digit = gl_WorkGroupID.x * kDigitsPerGroup + thread / kThreadsPerDigit;
  uint partitions = counters.work[pass.work].partitions;
  uint per_thread = (partitions + kThreadsPerDigit - 1u) / kThreadsPerDigit;
  uint begin = digit * kMaxPartitions + min(lane * per_thread, partitions);
  uint end = digit * kMaxPartitions + min(lane * per_thread + per_thread, partitions);

  uint sum = 0u;
  for (uint i = begin; i < end; ++i) sum += histogram[i];
  sums[thread] = sum;
  barrier();
  uint offset = 0u;
  for (uint i = thread - lane; i < thread; ++i) offset += sums[i];
  for (uint i = begin; i < end; ++i) {
    uint count = histogram[i];
    histogram[i] = offset;
    offset += count;
  }
  if (lane == kThreadsPerDigit - 1u) digit_totals[digit] = offset;
}
