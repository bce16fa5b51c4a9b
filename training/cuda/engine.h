// SPDX-License-Identifier: Apache-2.0
// Training with parameters, moments and statistics on the device (training/step/engine.h).
#pragma once
#include <memory>

#include "training/step/engine.h"

namespace tg::cuda {

// How much of a step's work exists at a time. It does not change the result.
struct StepParts {
  std::size_t gaussians = std::size_t{1} << 18;  // whose gradients are finished and moved: 62 MB with SH degree 3
  std::size_t texels = std::size_t{1} << 23;     // whose gradients are summed up: 268 MB (cutRanges())
  // [bytes] of photographs that steps under way hold in the host's memory: where they reach it, steps are waited for.
  std::size_t photographs = std::size_t{1} << 28;
};

// Opens no device: makeCudaDifferentiableRenderer() did.
std::unique_ptr<TrainingEngine> makeTrainingEngine(float ssim_weight, StepParts parts = {});

}  // namespace tg::cuda
