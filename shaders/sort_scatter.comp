#version 450
// SPDX-License-Identifier: Apache-2.0
// Radix sort, step 3 of 3: every pair to its place. Stable: 256 items at a time, ranked by 8 bit masks per digit, one
// bit per item, so that no subgroup size is assumed.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"
#include "group_scan.glsl"

const uint kMaskBits = 32u;
const uint kMasks = kGroupSize / kMaskBits;
layout(local_size_x = kGroupSize) in;
layout(std430, binding = 0) buffer CountersBlock { Counters counters; };
layout(std430, binding = 1) readonly buffer KeysIn { uint keys_in[]; };
layout(std430, binding = 2) readonly buffer ValuesIn { uint values_in[]; };
layout(std430, binding = 3) writeonly buffer KeysOut { uint keys_out[]; };
layout(std430, binding = 4) writeonly buffer ValuesOut { uint values_out[]; };
layout(std430, binding = 5) readonly buffer Histogram { uint histogram[]; };  // [kDigitCount, kMaxPartitions]
layout(std430, binding = 6) readonly buffer DigitTotals { uint digit_totals[]; };

shared uint masks[kMasks * kDigitCount];        // which of 32 items have a digit
shared uint mask_offsets[kMasks * kDigitCount]; // where the first of them goes

void main() {
  uint thread = gl_LocalInvocationIndex;
  uint part = gl_WorkGroupID.x;
  uint begin = part * counters.work[pass.work].partition_items;
  uint end = min(begin + counters.work[pass.work].partition_items, counters.work[pass.work].count);

  // As the keeper of digit number `thread`: where the next item with it goes.
  uint total;
  uint next = groupExclusiveScan(digit_totals[thread], total) + histogram[thread * kMaxPartitions + part];
  for (uint m = 0u; m < kMasks; ++m) masks[m * kDigitCount + thread] = 0u;
  barrier();

  uint mask_row = thread / kMaskBits * kDigitCount;
  uint bit = 1u << (thread % kMaskBits);
  for (uint first = begin; first < end; first += kGroupSize) {
    bool valid = first + thread < end;
    uint key = 0u;
    uint digit = 0u;
    if (valid) {
      key = keys_in[first + thread];
      digit = key >> pass.shift & (kDigitCount - 1u);
      atomicOr(masks[mask_row + digit], bit);
    }
    barrier();
    uint rank = bitCount(masks[mask_row + digit] & (bit - 1u));
    for (uint m = 0u; m < kMasks; ++m) {
      mask_offsets[m * kDigitCount + thread] = next;
      next += bitCount(masks[m * kDigitCount + thread]);
    }
    barrier();
    for (uint m = 0u; m < kMasks; ++m) masks[m * kDigitCount + thread] = 0u;
    if (valid) {
      uint place = mask_offsets[mask_row + digit] + rank;
      keys_out[place] = key;
      values_out[place] = values_in[first + thread];
    }
    barrier();
  }
}
