// SPDX-License-Identifier: Apache-2.0
// A pair of events a launch.
#include "training/cuda/timing.h"

#include <cuda_runtime.h>

#include <algorithm>

namespace tg::cuda {
namespace {

struct Timed {
  const char* name;
  cudaEvent_t begin, end;
};
bool timing = false;
std::vector<Timed> timed;

}  // namespace

LaunchTimer::LaunchTimer(const char* name) {
  if (!timing) return;
  Timed launch{name, nullptr, nullptr};
  cudaEventCreate(&launch.begin);
  cudaEventCreate(&launch.end);
  cudaEventRecord(launch.begin);
  timed.push_back(launch);
}
LaunchTimer::~LaunchTimer() {
  if (timing) cudaEventRecord(timed.back().end);
}

void timeKernels(bool on) {
  timing = on;
  if (!on) return;
  for (const Timed& launch : timed) {
    cudaEventDestroy(launch.begin);
    cudaEventDestroy(launch.end);
  }
  timed.clear();
}

std::vector<KernelTime> kernelTimes() {
  cudaDeviceSynchronize();
  std::vector<KernelTime> times;
  for (const Timed& launch : timed) {
    auto at = std::find_if(times.begin(), times.end(), [&](const KernelTime& t) { return t.name == launch.name; });
    if (at == times.end()) at = times.insert(times.end(), {launch.name, 0, 0.0});
    float milliseconds = 0;
    cudaEventElapsedTime(&milliseconds, launch.begin, launch.end);
    at->launches++;
    at->milliseconds += milliseconds;
  }
  return times;
}

}  // namespace tg::cuda
