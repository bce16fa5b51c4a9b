// SPDX-License-Identifier: Apache-2.0
// Training with parameters, moments and statistics on the device (training/engine.h).
#pragma once
#include <memory>

#include "training/engine.h"

namespace tg::cuda {

constexpr std::size_t kGradientRows = std::size_t{1} << 18;

// Opens no device: makeCudaDifferentiableRenderer() did. gradient_rows: so many Gaussians, and 16 times as many texels,
// are finished and moved at a time. It does not change the result.
std::unique_ptr<TrainingEngine> makeTrainingEngine(float ssim_weight, std::size_t gradient_rows = kGradientRows);

}  // namespace tg::cuda
