// SPDX-License-Identifier: Apache-2.0
// The CUDA side of train_bench: iterations per second of the training engine, and what each kernel does of what the
// device can do.
#pragma once
#include <cstdint>
#include <vector>

#include "core/model/camera.h"
#include "training/step/gradient.h"

namespace tg::bench {

struct CudaBench {
  const std::vector<Camera>& cameras;
  const std::vector<std::vector<std::uint8_t>>& photographs;  // [height * width * 3] of each camera
  double extent;
  double blended;  // (pixel, splat) pairs of a picture, for operations a second
  int iterations;
  bool statistics;  // as during densification
  bool measure_peak;
  int dictionary;  // textures, all of one size, that Gaussians share in turns; 0: each has its own
};
// Trains `model` and prints the tables. Throws Error(device).
void benchCuda(DifferentiableRenderer& renderer, GaussianModel model, const CudaBench& bench);

}  // namespace tg::bench
