// SPDX-License-Identifier: Apache-2.0
// Stands in for CUDA where a C++ compiler reads the kernels: a block's threads are fibers on one host thread, resumed
// in an order of our choosing between barriers and warp operations, blocks one after the other. It finds wrong results,
// orders that matter (missing barriers), barriers that some threads miss, unset memory and writes past buffers; it says
// nothing about speed, and nothing about races between blocks within one operation.
#pragma once
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <type_traits>

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

// Runs a kernel's body; throws std::logic_error when threads wait for what never happens.
void runBlocks(const char* name, std::size_t blocks, const std::function<void()>& body);

template <typename... Parameters, typename... Arguments>
void launch(const char* name, void (*kernel)(Parameters...), std::size_t blocks, Arguments... arguments) {
  const LaunchTimer timer(name);
  runBlocks(name, blocks, [&] { kernel(arguments...); });
}

// The block's shared memory, not-a-numbers at its start.
void* sharedBytes(std::size_t bytes);
template <typename T>
T& sharedMemory() {
  static_assert(std::is_trivially_default_constructible_v<T>);
  static_assert(sizeof(T) <= 48 * 1024, "more than every device gives a block");
  return *static_cast<T*>(sharedBytes(sizeof(T)));
}

// Waits until all lanes of the warp arrived with the same kind; then every lane may read all values until its next
// call.
enum class WarpOperation { shuffle, vote, match };
const std::uint64_t* exchangeInWarp(WarpOperation operation, std::uint64_t value);
const int* exchangeInBlock(int value);  // a barrier: the number of threads with a value other than 0

}  // namespace tg::cuda

inline void __syncthreads() { tg::cuda::exchangeInBlock(0); }
inline int __syncthreads_count(int value) { return *tg::cuda::exchangeInBlock(value); }

template <typename T>
T __shfl_xor_sync(unsigned, T value, unsigned mask) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof(T));
  bits = tg::cuda::exchangeInWarp(tg::cuda::WarpOperation::shuffle, bits)[(threadIdx.x % 32) ^ mask];
  std::memcpy(&value, &bits, sizeof(T));
  return value;
}
template <typename T>
T __shfl_sync(unsigned, T value, int lane) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof(T));
  bits = tg::cuda::exchangeInWarp(tg::cuda::WarpOperation::shuffle, bits)[lane];
  std::memcpy(&value, &bits, sizeof(T));
  return value;
}
inline unsigned __ballot_sync(unsigned, int predicate) {
  const std::uint64_t* lanes = tg::cuda::exchangeInWarp(tg::cuda::WarpOperation::vote, predicate != 0);
  unsigned bits = 0;
  for (unsigned lane = 0; lane < 32; ++lane) bits |= static_cast<unsigned>(lanes[lane]) << lane;
  return bits;
}
inline int __any_sync(unsigned mask, int predicate) { return __ballot_sync(mask, predicate) != 0; }
inline unsigned __match_any_sync(unsigned, int value) {
  const std::uint64_t* lanes =
      tg::cuda::exchangeInWarp(tg::cuda::WarpOperation::match, static_cast<std::uint32_t>(value));
  unsigned bits = 0;
  for (unsigned lane = 0; lane < 32; ++lane) {
    bits |= static_cast<unsigned>(lanes[lane] == static_cast<std::uint32_t>(value)) << lane;
  }
  return bits;
}
inline int __popc(unsigned bits) { return __builtin_popcount(bits); }
inline int __ffs(unsigned bits) { return __builtin_ffs(static_cast<int>(bits)); }

template <typename T>
T atomicAdd(T* at, T value) {
  const T old = *at;
  *at = old + value;
  return old;
}
template <typename T>
T atomicMax(T* at, T value) {
  const T old = *at;
  *at = old < value ? value : old;
  return old;
}
