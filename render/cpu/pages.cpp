// SPDX-License-Identifier: Apache-2.0
#include "render/cpu/pages.h"

#include <new>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace tg::cpu {
namespace {

constexpr std::size_t kLargePage = std::size_t{1} << 21, kCacheLine = 64;

// Less than a few large pages is not worth rounding up to one.
std::align_val_t alignment(std::size_t bytes) {
  return std::align_val_t{bytes >= 4 * kLargePage ? kLargePage : kCacheLine};
}

}  // namespace

void* allocatePages(std::size_t bytes) {
  void* memory = ::operator new(bytes, alignment(bytes));
#ifdef MADV_HUGEPAGE
  // A wish: what comes of it changes times alone.
  if (bytes >= 4 * kLargePage) static_cast<void>(madvise(memory, bytes / kLargePage * kLargePage, MADV_HUGEPAGE));
#endif
  return memory;
}

void freePages(void* memory, std::size_t bytes) noexcept { ::operator delete(memory, alignment(bytes)); }

}  // namespace tg::cpu
