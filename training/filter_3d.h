// SPDX-License-Identifier: Apache-2.0
// The 3D smoothing filter of Mip-Splatting (Yu et al. 2024, equation 8) with the opacity rule of this project's design:
// no Gaussian is thinner than what the training views resolve.
#pragma once
#include <span>
#include <vector>

#include "core/model.h"
#include "training/dataset.h"
#include "training/gradient.h"

namespace tg {

// [N] Size of a pixel at the Gaussian's mean, z / focal length, in the training view that sees it largest. Seen: nearer
// than nothing else matters - z beyond the near plane, and inside the image widened by 15 % a side. Gaussians that no
// view sees get the largest size of the others, 0 when there is none. [world units]
std::vector<float> pixelSizes(const Dataset& dataset, const GaussianModel& model);

// The filter's standard deviation: sqrt(0.2) pixels. [world units]
std::vector<float> minSigmas(const Dataset& dataset, const GaussianModel& model);

// What is drawn: sigma_eff = sqrt(sigma^2 + f^2) on each axis; opacity_eff = opacity * the product of sigma / sigma_eff
// over the two texture axes. The shortest axis is left out: it would make flat Gaussians vanish.
struct EffectiveParameters {
  std::vector<glm::vec3> log_scale;
  std::vector<float> opacity_logit;
};
void applyFilter(const GaussianModel& model, std::span<const float> min_sigma, EffectiveParameters& out);

// From gradients with respect to the effective parameters to those of the model's own, in place.
void filterGradient(const GaussianModel& model, std::span<const float> min_sigma, ModelGradient& gradient);

}  // namespace tg
