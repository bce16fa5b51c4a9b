// SPDX-License-Identifier: Apache-2.0
// A stable radix sort of 32-bit keys.
#pragma once
#include <cstdint>
#include <vector>

namespace tg::cpu {

struct DepthKey {
  std::uint32_t key;  // bits of a positive float: ordered as the float is
  std::uint32_t index;
};

// Ascending by key; equal keys keep their order. Parallel; the result does not depend on the number of threads.
void sortByKey(std::vector<DepthKey>& keys);

}  // namespace tg::cpu
