// SPDX-License-Identifier: Apache-2.0
// Fewer Gaussians: neighbours become one.
#pragma once
#include <cstddef>
#include <span>

#include "core/model/camera.h"
#include "core/model/model.h"

namespace tg {

// Leaves `count` Gaussians by merging pairs without textures, first those whose difference pictures from `views` show
// least: one Gaussian with their mass (opacity times area), mean and covariance. Where no pair is left, as `decimate`
// does. No change when there are no more than `count`. Throws Error(usage) for a count of 0.
void decimateByMerging(GaussianModel& model, std::size_t count, std::span<const Camera> views);

}  // namespace tg
