// SPDX-License-Identifier: Apache-2.0
// The language of the kernels. nvcc compiles them for GPUs; a C++ compiler that finds cuda_host.h (tests/support) makes
// the same text run on the host. Kernels keep to these rules: every thread of a block reaches every barrier, every lane
// of a warp every warp operation; a block's shared memory is one TG_BLOCK_SHARED struct without constructors. Of a
// TG_KERNEL_BLOCKS at least that many blocks have registers on a multiprocessor.
#pragma once
#include <cstdint>

#include "training/cuda/timing.h"

#ifdef __CUDACC__
#include <cuda_runtime.h>
#define TG_KERNEL __global__ void
#define TG_KERNEL_BLOCKS(blocks) __global__ void __launch_bounds__(tg::cuda::kThreads, blocks)
#define TG_DEVICE __device__ __forceinline__
#define TG_BLOCK_SHARED(Type, name) __shared__ Type name
#else
#include "cuda_host.h"
#define TG_KERNEL void
#define TG_KERNEL_BLOCKS(blocks) void
#define TG_DEVICE inline
#define TG_BLOCK_SHARED(Type, name) Type& name = tg::cuda::sharedMemory<Type>()
#endif

namespace tg::cuda {

constexpr unsigned kWarp = 32;
constexpr unsigned kAllLanes = 0xffffffffu;
constexpr unsigned kThreads = 256;  // of a block, everywhere

#ifdef __CUDACC__
// Throws Error(device) naming `what` unless the last call to the runtime succeeded.
void checkLaunch(const char* what);

// Runs `blocks` blocks of kThreads threads; none for 0.
template <typename... Parameters, typename... Arguments>
void launch(const char* name, void (*kernel)(Parameters...), std::size_t blocks, Arguments... arguments) {
  if (blocks == 0) return;
  const LaunchTimer timer(name);
  kernel<<<static_cast<unsigned>(blocks), kThreads>>>(arguments...);
  checkLaunch(name);
}
#endif

inline std::size_t blocksFor(std::size_t items) { return (items + kThreads - 1) / kThreads; }

// The item of a one-dimensional kernel's thread.
TG_DEVICE std::size_t itemIndex() { return static_cast<std::size_t>(blockIdx.x) * kThreads + threadIdx.x; }

// judgeStep()
TG_DEVICE bool stopped(const std::uint32_t* stop) { return stop != nullptr && *stop != 0; }

// 1 / x to two units in the last place: a correctly rounded one takes a branch on a device.
TG_DEVICE float reciprocal(float x) {
#ifdef __CUDACC__
  return __fdividef(1.0f, x);
#else
  return 1.0f / x;
#endif
}

TG_DEVICE float warpSum(float value) {
  for (unsigned offset = kWarp / 2; offset > 0; offset /= 2) value += __shfl_xor_sync(kAllLanes, value, offset);
  return value;
}

// Lanes that differ in bit 2 * kCount exchange halves of 2 * kCount values. A loop over kCount would not be unrolled
// everywhere, and arrays with an index that is not known beforehand lie in memory.
template <unsigned kCount>
TG_DEVICE void exchangeHalves(float (&values)[16], unsigned lane) {
  const bool upper = (lane & (2 * kCount)) != 0;
#pragma unroll
  for (unsigned k = 0; k < kCount; ++k) {
    const float keep = upper ? values[k + kCount] : values[k];
    const float give = upper ? values[k] : values[k + kCount];
    values[k] = keep + __shfl_xor_sync(kAllLanes, give, 2 * kCount);
  }
}
// Sixteen sums over a warp for the price of 16 shuffles instead of 80. Lane l returns the sum of values[l / 2]; the
// values are used up.
TG_DEVICE float warpSums16(float (&values)[16], unsigned lane) {
  exchangeHalves<8>(values, lane);
  exchangeHalves<4>(values, lane);
  exchangeHalves<2>(values, lane);
  exchangeHalves<1>(values, lane);
  return values[0] + __shfl_xor_sync(kAllLanes, values[0], 1);
}

// The sum over a block, in every thread, in a fixed order. scratch: kThreads / kWarp doubles of shared memory.
TG_DEVICE double blockSum(double value, double* scratch) {
  for (unsigned offset = kWarp / 2; offset > 0; offset /= 2) value += __shfl_xor_sync(kAllLanes, value, offset);
  __syncthreads();
  if (threadIdx.x % kWarp == 0) scratch[threadIdx.x / kWarp] = value;
  __syncthreads();
  double sum = 0;
  for (unsigned warp = 0; warp < kThreads / kWarp; ++warp) sum += scratch[warp];
  return sum;
}

}  // namespace tg::cuda
