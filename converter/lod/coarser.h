// SPDX-License-Identifier: Apache-2.0
// Fewer Gaussians for a picture from farther away.
#pragma once
#include <cstddef>

#include "core/model/model.h"

namespace tg {

// At most `count` >= 1 Gaussians: pairs of neighbours become one of their mass, mean and covariance, in rounds, those
// first whose size and colour change least for their mass; where that mass asks for an opacity above 1, wider ones.
// Textures have half their sides; of 2 x 2 and fewer the mean goes into colour and opacity. Its time grows with the
// Gaussians times their logarithm. Same model in, same bytes out.
GaussianModel coarser(const GaussianModel& model, std::size_t count);

}  // namespace tg
