// SPDX-License-Identifier: Apache-2.0
// Stands in for CUDA where a C++ compiler reads the kernels: a block's threads are fibers on one host thread, resumed
// in an order of our choosing between barriers and warp operations, blocks one after the other. It finds wrong results,
// orders that matter (missing barriers), barriers that some threads miss, unset memory and writes past buffers; it says
// nothing about speed. Races that left the result as it was are found in kernels compiled for cuda_check.h.
#pragma once
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "cuda_check.h"
#include "training/cuda/timing.h"

struct dim3 {
  unsigned x = 0, y = 0, z = 0;
};
inline dim3 threadIdx, blockIdx, gridDim;

namespace tg::cuda {

// In which order threads and blocks run. scrambled: another order between any two barriers.
enum class Schedule { forward, backward, scrambled };
void setSchedule(Schedule schedule, std::uint64_t seed = 0);

// What deviceMemory() says is free, of 1 GiB: 1 GiB until told otherwise.
void setFreeMemory(std::size_t bytes);

// By allocate(), less what was released.
std::size_t allocatedBytes();
// The most that were allocated at once since the last call.
std::size_t takePeakBytes();

// Kernels run since the program's start.
std::size_t launchCount();

// Runs a kernel's body, body(of), in every thread; throws std::logic_error when threads wait for what never happens,
// and for what cuda_check.h finds.
void runBlocks(const char* name, std::size_t blocks, void (*body)(const void* of), const void* of);

template <typename Body>
TG_UNCHECKED void callBody(const void* body) {
  (*static_cast<const Body*>(body))();
}
template <typename... Parameters, typename... Arguments>
void launch(const char* name, void (*kernel)(Parameters...), std::size_t blocks, Arguments... arguments) {
  const LaunchTimer timer(name);
  const auto body = [&]() TG_UNCHECKED { kernel(arguments...); };
  runBlocks(name, blocks, callBody<decltype(body)>, &body);
}

// The block's shared memory, not-a-numbers at its start.
void* sharedBytes(std::size_t bytes);
template <typename T>
T& sharedMemory() {
  static_assert(std::is_trivially_default_constructible_v<T>);
  static_assert(sizeof(T) <= 48 * 1024, "more than every device gives a block");
  return *static_cast<T*>(sharedBytes(sizeof(T)));
}

// Each waits until all lanes of the warp arrived with the same one. mask: all lanes.
std::uint64_t valueOfLane(unsigned mask, std::uint64_t value, unsigned lane);
unsigned lanesWith(unsigned mask, bool predicate);
unsigned lanesWithMine(unsigned mask, std::uint64_t value);
void warpBarrier(unsigned mask);
int blockBarrier(int value);  // the number of threads with a value other than 0

}  // namespace tg::cuda

inline void __syncthreads() { tg::cuda::blockBarrier(0); }
inline int __syncthreads_count(int value) { return tg::cuda::blockBarrier(value); }
inline void __syncwarp(unsigned mask = 0xffffffffu) { tg::cuda::warpBarrier(mask); }

template <typename T>
T __shfl_sync(unsigned mask, T value, int lane) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof(T));
  bits = tg::cuda::valueOfLane(mask, bits, static_cast<unsigned>(lane));
  std::memcpy(&value, &bits, sizeof(T));
  return value;
}
template <typename T>
T __shfl_xor_sync(unsigned mask, T value, unsigned lanes) {
  return __shfl_sync(mask, value, static_cast<int>((threadIdx.x % 32) ^ lanes));
}
inline unsigned __ballot_sync(unsigned mask, int predicate) { return tg::cuda::lanesWith(mask, predicate != 0); }
inline int __any_sync(unsigned mask, int predicate) { return __ballot_sync(mask, predicate) != 0; }
inline unsigned __match_any_sync(unsigned mask, int value) {
  return tg::cuda::lanesWithMine(mask, static_cast<std::uint32_t>(value));
}
inline int __popc(unsigned bits) { return __builtin_popcount(bits); }
inline int __clz(int bits) { return bits == 0 ? 32 : __builtin_clz(static_cast<unsigned>(bits)); }
inline int __ffs(unsigned bits) { return __builtin_ffs(static_cast<int>(bits)); }

template <typename T>
TG_UNCHECKED T atomicAdd(T* at, T value) {
  tg::cuda::check::atomic(at, sizeof(T));
  const T old = *at;
  *at = old + value;
  return old;
}
template <typename T>
TG_UNCHECKED T atomicMax(T* at, T value) {
  tg::cuda::check::atomic(at, sizeof(T));
  const T old = *at;
  *at = old < value ? value : old;
  return old;
}
