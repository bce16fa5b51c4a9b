// SPDX-License-Identifier: Apache-2.0
// What a CUDA device can do at most, measured: what the shares of kernels are shares of.
#pragma once
#include <cstddef>

namespace tg::bench {

struct CudaPeak {
  double bytes;  // [1/s] read and written by a copy
  double flops;  // [1/s] of multiply-adds in float, two each
};
// bytes: of the array that is copied. blocks of 256 threads; steps: multiply-adds in a row of a thread's 16 chains.
CudaPeak cudaPeak(std::size_t bytes, std::size_t blocks, int steps);

}  // namespace tg::bench
