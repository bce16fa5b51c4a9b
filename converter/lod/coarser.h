// SPDX-License-Identifier: Apache-2.0
// Fewer Gaussians for a picture from farther away.
#pragma once
#include <cstddef>

#include "core/model/model.h"

namespace tg {

// At most `count` >= 1 Gaussians, each in the place of neighbours: cells of equally many by splits at the median of the
// longer side, one Gaussian of a cell's mass, mean and covariance, as Kerbl et al. 2024 (Hierarchical 3D Gaussians,
// section 4) merge nodes. Textures have half their sides; of 2 x 2 and fewer the mean goes into colour and opacity.
// Its time grows with the Gaussians times the logarithm of `count`. Same model in, same bytes out.
GaussianModel coarser(const GaussianModel& model, std::size_t count);

}  // namespace tg
