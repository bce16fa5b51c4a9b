// SPDX-License-Identifier: Apache-2.0
// Takes from what every Gaussian carries: texels, textures.
#pragma once
#include "core/model/model.h"

namespace tg {

// Every texture that there is at width x height texels, 1 to 1024: the texture of that size that is closest in the mean
// square over the plane, weighted with the square of the Gaussian (converter/edit/texture_fit.h).
void resizeTextures(GaussianModel& model, int width, int height);

// The best untextured stand-in (converter/gltf/fallback.h) in the model's place.
void dropTextures(GaussianModel& model);

}  // namespace tg
