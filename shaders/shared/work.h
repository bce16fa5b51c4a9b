// SPDX-License-Identifier: Apache-2.0
// How many items a pass has when only the device knows, and the dispatch sizes that follow from it.
#ifndef TG_WORK_H
#define TG_WORK_H
#include "shared/lang.h"
TG_NAMESPACE_BEGIN

const uint kGroupSize = 256u;            // threads of a one-dimensional pass
const uint kMaxGroupsPerRow = 32768u;    // power of two below 65535, the least a device allows per axis
const uint kMaxPartitions = 512u;        // 131072 threads: enough to fill a GPU, few enough for one group to scan
const uint kPartitionStep = 1024u;       // partitions are a multiple of this: 4 items per thread
const uint kSmallestPartition = 2048u;   // below, the 256 counters of a partition outweigh its items
const uint kDigitCount = 256u;           // radix of the sort: one digit per thread of a group
const uint kDigitBits = 8u;
const uint kRunThreads = 16u;            // threads of a group where each thread has a partition of its own

// Items of one kind. The items are cut into `partitions` consecutive runs of `partition_items` for scans and sorts.
struct Work {
  uint count;              // items to process: min(total, capacity of their buffer)
  uint total;              // items there are; 2^32 - 1 stands for that many or more
  uint partition_items;
  uint partitions;
  uvec4 item_groups;       // dispatch arguments (x, y, z): one thread per item
  uvec4 partition_groups;  // dispatch arguments (x, y, z): one group per partition
};
TG_CHECK_SIZE(Work, 48)

TG_FN uvec4 groupGrid(uint groups) {
  uint x = min(groups, kMaxGroupsPerRow);
  return uvec4(x, (groups + kMaxGroupsPerRow - 1u) / kMaxGroupsPerRow, 1u, 0u);
}

TG_FN Work makeWork(uint total, uint capacity) {
  Work work;
  work.count = min(total, capacity);
  work.total = total;
  uint items = max(work.count / kMaxPartitions + 1u, kSmallestPartition);
  work.partition_items = (items + kPartitionStep - 1u) / kPartitionStep * kPartitionStep;
  work.partitions = work.count / work.partition_items + (work.count % work.partition_items == 0u ? 0u : 1u);
  work.item_groups = groupGrid(work.count / kGroupSize + (work.count % kGroupSize == 0u ? 0u : 1u));
  work.partition_groups = groupGrid(work.partitions);
  return work;
}

// Sums of items stop at 2^32 - 1.
TG_FN uint addSaturated(uint a, uint b) {
  uint sum = a + b;
  return sum < a ? 0xFFFFFFFFu : sum;
}

// The kinds of items of a frame.
const uint kWorkGaussians = 0u;  // of the model
const uint kWorkVisible = 1u;    // splats that reach the screen
const uint kWorkPairs = 2u;      // (tile, splat)
const uint kWorkKinds = 3u;

// Written by the device, read back after the frame.
struct Counters {
  Work work[kWorkKinds];
  uvec4 output_range;  // smallest and largest number above 0 of the shown output (float bits), unused
  uint longest_list;   // most pairs that a tile has
  uint unused0;
  uint unused1;
  uint unused2;
};
TG_CHECK_SIZE(Counters, 176)

// What one dispatch is told beside the view. A pass reads the members it needs.
struct PassUniforms {
  uint work;       // kWork*: its items
  uint next_work;  // kWork*: the items that its total counts
  uint capacity;   // room for next_work's items
  uint shift;      // lowest bit of the sort digit
  uint first;      // project: Gaussian of the first thread; blend, solid: first list entry
  uint count;      // project: Gaussians; blend, solid: list entries at most
  uint output_kind;  // present: kOutput*
  uint unused;
};
TG_CHECK_SIZE(PassUniforms, 32)

TG_NAMESPACE_END
#endif
