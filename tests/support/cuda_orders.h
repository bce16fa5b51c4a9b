// SPDX-License-Identifier: Apache-2.0
// The cases of training_cuda_test run twice: on the host, which orders the threads as a test wants (cuda_host.h), and,
// built by nvcc with TG_CUDA_ON_DEVICE, on a device, which orders them as it likes.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#ifndef TG_CUDA_ON_DEVICE
#include "cuda_host.h"
#endif

namespace tg::test {

// Calls body() for results that must not depend on the order of threads and blocks: under other orders on the host, a
// few times more on a device.
template <typename Body>
void inOtherOrders(const Body& body) {
#ifdef TG_CUDA_ON_DEVICE
  for (int repeat = 0; repeat < 4; ++repeat) body();
#else
  cuda::setSchedule(cuda::Schedule::backward);
  body();
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    cuda::setSchedule(cuda::Schedule::scrambled, seed);
    body();
  }
  cuda::setSchedule(cuda::Schedule::forward);
#endif
}

// Whether a kernel's numbers are the host's: equal where the host ran it; to 1e-5 of the number, and as much where it
// is below 1, on a device, whose compiler contracts sums and whose exponential is another.
inline bool sameNumbers(std::span<const float> found, std::span<const float> expected) {
#ifdef TG_CUDA_ON_DEVICE
  constexpr float kBand = 1e-5f;
#else
  constexpr float kBand = 0.0f;
#endif
  return std::equal(found.begin(), found.end(), expected.begin(), expected.end(),
                    [](float a, float b) { return a == b || std::abs(a - b) <= kBand * std::max(std::abs(b), 1.0f); });
}
template <typename Vector>
std::span<const float> numbers(const std::vector<Vector>& values) {
  return {reinterpret_cast<const float*>(values.data()), values.size() * sizeof(Vector) / sizeof(float)};
}

}  // namespace tg::test
