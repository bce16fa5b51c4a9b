// SPDX-License-Identifier: Apache-2.0
// Colours of linear light, as KHR_gaussian_splatting's lin_rec709_display has them, as the model's, which are sRGB.
#pragma once
#include <cstddef>

#include "core/model/model.h"

namespace tg {

// Turns DC, SH and texels of Gaussians `first` to the last: exact for what is opaque and looks the same from
// everywhere. Of view dependence a secant stands for the curve; a mixture of Gaussians is encoded part by part, not as
// a whole.
void encodeLinearColors(GaussianModel& model, std::size_t first);

}  // namespace tg
