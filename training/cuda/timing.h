// SPDX-License-Identifier: Apache-2.0
// How long each kernel takes, for benchmarks. timing.cu asks the device's events, tests/support/cuda_host.cpp the
// clock.
#pragma once
#include <cstddef>
#include <string>
#include <vector>

namespace tg::cuda {

struct KernelTime {
  std::string name;  // of the launch
  std::size_t launches;
  double milliseconds;  // of all of them
};

// On: launches are timed from here on, and those timed before are forgotten.
void timeKernels(bool on);
// In the order of their first launch. Waits for all of them.
std::vector<KernelTime> kernelTimes();

// Times what is launched while it lives.
class LaunchTimer {
 public:
  explicit LaunchTimer(const char* name);
  ~LaunchTimer();
  LaunchTimer& operator=(LaunchTimer&&) = delete;
};

}  // namespace tg::cuda
