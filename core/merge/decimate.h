// SPDX-License-Identifier: Apache-2.0
// Fewer Gaussians for nearly the same pictures.
#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "core/model/model.h"

namespace tg {

// `weights`: [N], how much pictures show of each [px], blendWeights() of render/contribution.h.

// Leaves `count` Gaussians, those that pictures show most; of the unseen ones the opaque and large first. No change
// when there are no more than that. Throws Error(usage) for a count of 0.
void decimate(GaussianModel& model, std::size_t count, std::span<const double> weights);

// Leaves `count` Gaussians by merging pairs, first those whose difference pictures show least: one Gaussian with their
// mass (opacity times area), mean and covariance, textures resampled onto it. Where removing one shows less than
// merging it, it goes. Where no pair is left, as `decimate` does. No change when there are no more than `count`. Throws
// Error(usage) for a count of 0.
void decimateByMerging(GaussianModel& model, std::size_t count, std::vector<double> weights);

}  // namespace tg
