// SPDX-License-Identifier: Apache-2.0
// What a prefix sum adds up, for the two passes that read it.
const uint kScanValues = 0u;   // values[i]
const uint kScanNonZero = 1u;  // 1 where values[i] > 0: positions of the visible
const uint kScanOrdered = 2u;  // values[order[i]]: in depth order
layout(constant_id = 0) const uint kScanInput = kScanValues;

layout(std430, binding = 0) buffer CountersBlock { Counters counters; };
layout(std430, binding = 1) readonly buffer Values { uint values[]; };
layout(std430, binding = 2) readonly buffer Order { uint order[]; };

uint scanInput(uint i) {
  if (kScanInput == kScanOrdered) return values[order[i]];
  if (kScanInput == kScanNonZero) return min(values[i], 1u);
  return values[i];
}
