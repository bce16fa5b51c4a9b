// SPDX-License-Identifier: Apache-2.0
// Large arrays that are read here and there: in large pages, where the system has them, or the processor waits for
// the addresses of pages more than for the data.
#pragma once
#include <cstddef>

namespace tg::cpu {

// Uninitialised; a cache line's alignment at least. Throws std::bad_alloc.
void* allocatePages(std::size_t bytes);
void freePages(void* memory, std::size_t bytes) noexcept;

// Asks for large pages under memory that is in use already, and is worth it if it is large: takes as long as copying it
// once. Its contents stay as they are.
void enlargePages(const void* memory, std::size_t bytes) noexcept;

}  // namespace tg::cpu
