// SPDX-License-Identifier: Apache-2.0
// Large arrays on large pages: the first touch of half a gigabyte costs a fault per 2 MiB instead of one per 4 KiB.
#pragma once
#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tg {

// vector.reserve(n) of an empty vector. Where the kernel has no large pages to give, it is just that.
template <typename T>
void reserveHuge(std::vector<T>& vector, std::size_t n) {
  constexpr std::uintptr_t kHugePage = std::uintptr_t{2} << 20;
  vector.reserve(n);
#ifdef MADV_HUGEPAGE
  const auto begin = reinterpret_cast<std::uintptr_t>(vector.data());
  const std::uintptr_t first = (begin + kHugePage - 1) / kHugePage * kHugePage;
  const std::uintptr_t last = (begin + n * sizeof(T)) / kHugePage * kHugePage;
  if (last > first) (void)madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE);
#endif
}

template <typename T>
void resizeHuge(std::vector<T>& vector, std::size_t n) {
  reserveHuge(vector, n);
  vector.resize(n);
}

}  // namespace tg
