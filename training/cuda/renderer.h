// SPDX-License-Identifier: Apache-2.0
// The CUDA backend of training (training/step/gradient.h).
#pragma once
#include <memory>

#include "training/step/gradient.h"

namespace tg {

// Throws Error(device) where there is no driver, no device, or none that this program holds code for.
std::unique_ptr<DifferentiableRenderer> makeCudaDifferentiableRenderer();

}  // namespace tg
