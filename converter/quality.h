// SPDX-License-Identifier: Apache-2.0
// How much a written file differs from its source, seen through a few cameras.
#pragma once
#include <span>
#include <vector>

#include "converter/read_model.h"

namespace tg {

// At most four views at a small size: evenly spaced ones of the model's own cameras, or a ring around it.
std::vector<Camera> qualityViews(const GaussianModel& model, std::span<const Camera> cameras);

// More and smaller ones, at most 24, that between them see what a decision about every Gaussian must know.
std::vector<Camera> contributionViews(const GaussianModel& model, std::span<const Camera> cameras);

// PSNR [dB] of all views' pixels together, clamped to [0, 1]; infinity when equal. Rendered on the CPU.
double renderedPsnr(const GaussianModel& a, const GaussianModel& b, std::span<const Camera> views,
                    glm::vec3 background);

}  // namespace tg
