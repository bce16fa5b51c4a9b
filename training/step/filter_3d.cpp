// SPDX-License-Identifier: Apache-2.0
// One Gaussian at a time, in double precision where differences of near-equal sigmas matter.
#include "training/step/filter_3d.h"

#include <algorithm>
#include <cmath>

#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "training/step/step_math.h"

namespace tg {

std::vector<Pinhole> filterCameras(const Dataset& dataset) {
  const std::vector<Camera> views = trainingViews(dataset);
  return {views.begin(), views.end()};
}

std::vector<float> seenPixelSizes(std::span<const Pinhole> cameras, const GaussianModel& model) {
  std::vector<float> sizes(model.size(), 0.0f);
  parallelFor(static_cast<std::int64_t>(model.size()), kGaussiansPerTask,
              [&](std::int64_t i) { sizes[i] = pixelSizeAt(model.mean[i], cameras.data(), cameras.size()); });
  return sizes;
}

float largestOf(std::span<const float> sizes) {
  return sizes.empty() ? 0.0f : *std::max_element(sizes.begin(), sizes.end());
}

std::vector<float> pixelSizes(std::span<const Pinhole> cameras, const GaussianModel& model) {
  std::vector<float> sizes = seenPixelSizes(cameras, model);
  std::replace(sizes.begin(), sizes.end(), 0.0f, largestOf(sizes));
  return sizes;
}

std::vector<float> minSigmas(std::span<const Pinhole> cameras, const GaussianModel& model) {
  std::vector<float> sizes = seenPixelSizes(cameras, model);
  makeMinSigmas(largestOf(sizes), sizes);
  return sizes;
}

void makeMinSigmas(float largest, std::span<float> sizes) {
  for (float& size : sizes) size = (size == 0.0f ? largest : size) * std::sqrt(kFilterVariance);
}

void applyFilter(const GaussianModel& model, std::span<const float> min_sigma, EffectiveParameters& out) {
  TG_ASSERT(min_sigma.size() == model.size(), "a sigma a Gaussian");
  out.log_scale.resize(model.size());
  out.opacity_logit.resize(model.size());
  parallelFor(static_cast<std::int64_t>(model.size()), kGaussiansPerTask, [&](std::int64_t i) {
    const EffectiveGaussian effective = effectiveGaussian(model.log_scale[i], model.opacity_logit[i], min_sigma[i]);
    out.log_scale[i] = effective.log_scale;
    out.opacity_logit[i] = effective.opacity_logit;
  });
}

void filterGradient(const GaussianModel& model, std::span<const float> min_sigma, ModelGradient& gradient) {
  TG_ASSERT(min_sigma.size() == model.size(), "a sigma a Gaussian");
  TG_ASSERT(gradient.log_scale.size() == model.size() && gradient.opacity_logit.size() == model.size(),
            "the gradient has the model's size");
  parallelFor(static_cast<std::int64_t>(model.size()), kGaussiansPerTask, [&](std::int64_t i) {
    filterGradientOf(model.log_scale[i], model.opacity_logit[i], min_sigma[i], gradient.log_scale[i],
                     gradient.opacity_logit[i]);
  });
}

}  // namespace tg
