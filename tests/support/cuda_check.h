// SPDX-License-Identifier: Apache-2.0
// What compute-sanitizer looks for on a device, looked for on the host: accesses outside the device's memory or not
// aligned to their size (memcheck), reads of what nothing wrote (initcheck), and accesses of two threads to one byte, a
// write among them, that CUDA's memory model does not order (racecheck; between blocks, too).
//
// TG_CUDA_CHECK: the kernels are compiled with -fsanitize=thread, which calls a function at every access to memory that
// others can see. Those functions are cuda_check.cpp's, not ThreadSanitizer's, which keeps the clocks of 255 threads at
// a time and knows no warps. What orders two accesses in a launch is exact and does not depend on the order in which
// the host ran them: __syncthreads() within a block, __syncwarp() within a warp; shuffles and votes order nothing, nor
// do atomics, which conflict with all but each other. Launches are one after the other; a copy on another stream is
// cuda_upload_host.cpp's.
#pragma once
#include <cstddef>
#include <string>

namespace tg::cuda::check {

#ifdef TG_CUDA_CHECK
#define TG_UNCHECKED __attribute__((no_sanitize("thread")))

void allocated(const void* memory, std::size_t bytes);
void released(const void* memory);
// By the host, or by what stands in for a kernel of cub. Throws std::logic_error as a kernel's access does.
void wrote(const void* memory, std::size_t bytes);
void reads(const void* memory, std::size_t bytes);
void forget(const void* memory, std::size_t bytes);  // from here on nothing wrote it

void beginLaunch();
void endLaunch();
void beginBlock(unsigned block);
void useShared(const void* memory, std::size_t bytes);  // of the block
void runThread(unsigned thread, const void* stack, std::size_t stack_bytes);
void blockBarrier();
void warpBarrier(unsigned warp);
void atomic(const void* memory, std::size_t bytes);
// The first thing found since the last call; empty: nothing.
std::string takeFinding();
#else
#define TG_UNCHECKED

inline void allocated(const void*, std::size_t) {}
inline void released(const void*) {}
inline void wrote(const void*, std::size_t) {}
inline void reads(const void*, std::size_t) {}
inline void forget(const void*, std::size_t) {}
inline void beginLaunch() {}
inline void endLaunch() {}
inline void beginBlock(unsigned) {}
inline void useShared(const void*, std::size_t) {}
inline void runThread(unsigned, const void*, std::size_t) {}
inline void blockBarrier() {}
inline void warpBarrier(unsigned) {}
inline void atomic(const void*, std::size_t) {}
inline std::string takeFinding() { return {}; }
#endif

}  // namespace tg::cuda::check
