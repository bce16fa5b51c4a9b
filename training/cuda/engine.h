// SPDX-License-Identifier: Apache-2.0
// Training with parameters, moments and statistics on the device (training/engine.h).
#pragma once
#include <memory>

#include "training/engine.h"

namespace tg::cuda {

// Opens no device: makeCudaDifferentiableRenderer() did.
std::unique_ptr<TrainingEngine> makeTrainingEngine(float ssim_weight);

}  // namespace tg::cuda
