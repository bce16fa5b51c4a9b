// SPDX-License-Identifier: Apache-2.0
// Fewer Gaussians for nearly the same pictures.
#pragma once
#include <cstddef>
#include <span>

#include "core/model/camera.h"
#include "core/model/model.h"

namespace tg {

// Leaves `count` Gaussians, those that pictures from `views` show most (render/contribution.h); of the unseen
// ones the opaque and large first. No change when there are no more than that. Throws Error(usage) for a count of 0.
void decimate(GaussianModel& model, std::size_t count, std::span<const Camera> views);

// Leaves `count` Gaussians by merging pairs, first those whose difference pictures from `views` show least: one
// Gaussian with their mass (opacity times area), mean and covariance, textures resampled onto it. Where
// removing one shows less than merging it, it goes. Where no pair is
// left, as `decimate` does. No change when there are no more than `count`. Throws Error(usage) for a count of 0.
void decimateByMerging(GaussianModel& model, std::size_t count, std::span<const Camera> views);

}  // namespace tg
