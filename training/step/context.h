// SPDX-License-Identifier: Apache-2.0
// Gaussians that are drawn beside those in training and stay as they are: a coarse model of the scene around a block.
#pragma once
#include <memory>

#include "core/model/model.h"
#include "training/step/gradient.h"

namespace tg {

// A renderer of every model together with `context`, which has no textures; gradients and weights are of the model
// alone, with the context in front of it and behind. The context has the model's SH degree, cut or with zeros, and its
// intersection. A training step copies the model once.
std::unique_ptr<DifferentiableRenderer> withContext(std::unique_ptr<DifferentiableRenderer> renderer,
                                                    GaussianModel context);

}  // namespace tg
