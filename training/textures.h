// SPDX-License-Identifier: Apache-2.0
// The step from plain to textured Gaussians, between the two training stages.
#pragma once
#include "training/optimizer.h"

namespace tg {

// Gives every Gaussian size x size neutral texels (colour 0, alpha 1): the picture stays the same to the last bit, and
// both signs of colour are reachable. All moments start afresh, as stage 2 is its own optimisation.
void addTextures(TrainingState& state, int size, TextureMode mode);

}  // namespace tg
