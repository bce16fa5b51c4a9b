// SPDX-License-Identifier: Apache-2.0
// The 3D filter (docs/math.md 8): no Gaussian is thinner than what the training views resolve.
#pragma once
#include <span>
#include <vector>

#include "core/model/model.h"
#include "training/data/dataset.h"
#include "training/step/density_math.h"
#include "training/step/gradient.h"

namespace tg {

// The training views.
std::vector<Pinhole> filterCameras(const Dataset& dataset);

// [N] Size of a pixel at the Gaussian's mean, z / focal length, in the training view that sees it largest. Seen: nearer
// than nothing else matters - z beyond the near plane, and inside the image widened by 15 % a side. Gaussians that no
// view sees get the largest size of the others, 0 when there is none. [world units]
std::vector<float> pixelSizes(std::span<const Pinhole> cameras, const GaussianModel& model);

// The filter's standard deviation: sqrt(0.2) pixels. [world units]
std::vector<float> minSigmas(std::span<const Pinhole> cameras, const GaussianModel& model);

// Its steps, for a model of which others have the rest: sizes that are 0 where no view sees the Gaussian; the largest,
// 0 of none; sizes become minSigmas(), given the largest of the whole model.
std::vector<float> seenPixelSizes(std::span<const Pinhole> cameras, const GaussianModel& model);
float largestOf(std::span<const float> sizes);
void makeMinSigmas(float largest, std::span<float> sizes);

// What is drawn (8a).
struct EffectiveParameters {
  std::vector<glm::vec3> log_scale;
  std::vector<float> opacity_logit;
};
void applyFilter(const GaussianModel& model, std::span<const float> min_sigma, EffectiveParameters& out);

// From gradients with respect to the effective parameters to those of the model's own (8b, 8c), in place.
void filterGradient(const GaussianModel& model, std::span<const float> min_sigma, ModelGradient& gradient);

}  // namespace tg
