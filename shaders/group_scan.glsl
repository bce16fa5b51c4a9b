// SPDX-License-Identifier: Apache-2.0
// Prefix sums over the 256 threads of a group: 16 runs of 16, two barriers and no subgroup operation. Sums stop at
// 2^32 - 1 instead of wrapping, so that a frame with too many pairs is seen as such.
#include "shared/work.h"

const uint kRun = 16u;  // sqrt(kGroupSize)
shared uint scan_values[kGroupSize];
shared uint scan_runs[kRun];

// Sum of `value` over the threads before this one; `total` over all. All threads must call it.
uint groupExclusiveScan(uint value, out uint total) {
  uint thread = gl_LocalInvocationIndex;
  barrier();  // an earlier call may still be reading
  scan_values[thread] = value;
  barrier();
  if (thread < kRun) {
    uint sum = 0u;
    for (uint i = 0u; i < kRun; ++i) sum = addSaturated(sum, scan_values[thread * kRun + i]);
    scan_runs[thread] = sum;
  }
  barrier();
  uint run = thread / kRun;
  uint before = 0u;
  total = 0u;
  for (uint i = 0u; i < kRun; ++i) {
    if (i == run) before = total;
    total = addSaturated(total, scan_runs[i]);
  }
  for (uint i = run * kRun; i < thread; ++i) before = addSaturated(before, scan_values[i]);
  return before;
}
