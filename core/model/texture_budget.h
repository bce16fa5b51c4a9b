// SPDX-License-Identifier: Apache-2.0
// A texture size for every Gaussian.
#pragma once
#include <cstdint>
#include <span>

#include "core/model/model.h"

namespace tg {

// Every texture that there is at width x height texels, 1 to 1024: the texture of that size that is closest in the mean
// square over the plane, weighted with the square of the Gaussian (core/model/texture_fit.h).
void resizeTextures(GaussianModel& model, int width, int height);

// ---- By what its trained texels show

// Sides are 1, 2, 4, 8, ... 512 texels up to the texture's own, its own, or none at all: the texture's mean goes into
// colour and opacity then (core/model/fallback.h). The error of a size is that of the best texture of it
// (core/model/texture_fit.h): the root of the mean square over colour channels and alpha that the mode has,
// weighted with the square of the Gaussian, times the opacity.

// The fewest texels per texture whose error is at most `error` (in [0, 1], colour 1 is white). Throws Error(usage) for
// a negative error.
void fitTexturesToError(GaussianModel& model, double error);

// At most `texels` texels in all, where they take most error off pictures: greedy on the convex hull of every texture's
// sizes, squared errors weighted with [N] `weights` [px], blendWeights() of render/contribution.h.
void fitTexturesToBudget(GaussianModel& model, std::uint64_t texels, std::span<const double> weights);

}  // namespace tg
