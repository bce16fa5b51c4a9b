// SPDX-License-Identifier: Apache-2.0
// Least significant digit first, 8 bits a pass; every chunk counts and scatters on its own.
#include "render/cpu/sort.h"

#include <algorithm>
#include <array>

#include "core/system/parallel.h"

namespace tg::cpu {

void sortByKey(std::vector<DepthKey>& keys) {
  constexpr std::size_t kChunk = 32768;  // 256 KiB of keys: a few chunks a core on large scenes, one on small ones
  const std::size_t chunks = (keys.size() + kChunk - 1) / kChunk;
  std::vector<std::array<std::uint32_t, 256>> starts(chunks);
  std::vector<DepthKey> sorted(keys.size());
  for (int shift = 0; shift < 32; shift += 8) {
    const auto digit = [shift](const DepthKey& k) { return (k.key >> shift) & 255u; };
    const auto range = [&](std::int64_t chunk) {
      const std::size_t begin = static_cast<std::size_t>(chunk) * kChunk;
      return std::pair(begin, std::min(keys.size(), begin + kChunk));
    };
    parallelFor(static_cast<std::int64_t>(chunks), 1, [&](std::int64_t chunk) {
      starts[chunk].fill(0);
      const auto [begin, end] = range(chunk);
      for (std::size_t i = begin; i < end; ++i) ++starts[chunk][digit(keys[i])];
    });
    std::uint32_t next = 0;
    for (std::size_t d = 0; d < 256; ++d) {
      for (auto& start : starts) {
        const std::uint32_t count = start[d];
        start[d] = next;
        next += count;
      }
    }
    parallelFor(static_cast<std::int64_t>(chunks), 1, [&](std::int64_t chunk) {
      const auto [begin, end] = range(chunk);
      for (std::size_t i = begin; i < end; ++i) sorted[starts[chunk][digit(keys[i])]++] = keys[i];
    });
    keys.swap(sorted);
  }
}

}  // namespace tg::cpu
