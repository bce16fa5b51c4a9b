// SPDX-License-Identifier: Apache-2.0
// How much of a model's pictures each of its Gaussians is.
#pragma once
#include <span>
#include <vector>

#include "core/model/camera.h"
#include "core/model/model.h"
#include "shared/limits.h"

namespace tg {

// [N]: the weights T alpha with which a Gaussian is blended, summed over all pixels of all views [px]; as the renderers
// have it, textures' alpha included. Those that no view shows have 0. Means and hits at or before `near` are not drawn.
std::vector<double> blendWeights(const GaussianModel& model, std::span<const Camera> views, float near = kNear);

}  // namespace tg
