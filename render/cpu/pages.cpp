// SPDX-License-Identifier: Apache-2.0
// Linux' madvise.
#include "render/cpu/pages.h"

#include <cstdint>
#include <new>

#ifdef __linux__
#include <linux/mman.h>
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
#if defined(MADV_HUGEPAGE)
  // A wish: what comes of it changes times alone.
  if (bytes >= 4 * kLargePage) static_cast<void>(madvise(memory, bytes / kLargePage * kLargePage, MADV_HUGEPAGE));
#endif
  return memory;
}

void freePages(void* memory, std::size_t bytes) noexcept { ::operator delete(memory, alignment(bytes)); }

void enlargePages(const void* memory, std::size_t bytes) noexcept {
#if defined(MADV_HUGEPAGE)
  const std::size_t skipped = (kLargePage - reinterpret_cast<std::uintptr_t>(memory) % kLargePage) % kLargePage;
  if (bytes < skipped + 4 * kLargePage) return;
  char* whole = const_cast<char*>(static_cast<const char*>(memory)) + skipped;
  const std::size_t length = (bytes - skipped) / kLargePage * kLargePage;
  static_cast<void>(madvise(whole, length, MADV_HUGEPAGE));
#ifdef MADV_COLLAPSE  // Linux 6.1: at once instead of in the background
  static_cast<void>(madvise(whole, length, MADV_COLLAPSE));
#endif
#else
  static_cast<void>(memory), static_cast<void>(bytes);
#endif
}

}  // namespace tg::cpu
