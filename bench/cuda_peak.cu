// SPDX-License-Identifier: Apache-2.0
// One kernel that only copies, one that only multiplies.
#include "cuda_peak.h"

#include "training/cuda/device.h"
#include "training/cuda/memory.h"
#include "training/cuda/timing.h"

namespace tg::cuda {
namespace {

constexpr int kRepeats = 10;
constexpr int kChains = 16;

struct alignas(16) Quad {
  float x, y, z, w;
};

TG_KERNEL copyKernel(const Quad* from, Quad* to, std::size_t count) {
  const std::size_t i = itemIndex();
  if (i < count) to[i] = from[i];
}

// The result is written where no compiler can know that it never is.
TG_KERNEL multiplyKernel(float factor, int steps, float* result) {
  float chains[kChains];
  for (int k = 0; k < kChains; ++k) chains[k] = static_cast<float>(threadIdx.x + k);
  for (int step = 0; step < steps; ++step) {
#pragma unroll
    for (int k = 0; k < kChains; ++k) chains[k] = ::fmaf(chains[k], factor, 1.0f);
  }
  float sum = 0.0f;
  for (int k = 0; k < kChains; ++k) sum += chains[k];
  if (sum == -1.0f) *result = sum;
}

}  // namespace
}  // namespace tg::cuda

namespace tg::bench {

CudaPeak cudaPeak(std::size_t bytes, std::size_t blocks, int steps) {
  using namespace tg::cuda;
  const std::size_t quads = bytes / sizeof(Quad);
  Buffer<Quad> from, to;
  Buffer<float> result;
  from.resize(quads);
  to.resize(quads);
  result.resize(1);
  from.zero();
  for (int warm = 0; warm < 2; ++warm) {
    timeKernels(true);
    for (int repeat = 0; repeat < kRepeats; ++repeat) {
      launch("copy", copyKernel, blocksFor(quads), static_cast<const Quad*>(from.data()), to.data(), quads);
      launch("multiply", multiplyKernel, blocks, 0.5f, steps, result.data());
    }
  }
  const std::vector<KernelTime> times = kernelTimes();
  timeKernels(false);
  const double copied = 2.0 * static_cast<double>(quads * sizeof(Quad)) * kRepeats;
  const double multiplied = 2.0 * kChains * steps * static_cast<double>(blocks * kThreads) * kRepeats;
  return {copied / (times[0].milliseconds * 1e-3), multiplied / (times[1].milliseconds * 1e-3)};
}

}  // namespace tg::bench
