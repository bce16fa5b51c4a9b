// SPDX-License-Identifier: Apache-2.0
// One Gaussian at a time, in double precision where differences of near-equal sigmas matter.
#include "training/filter_3d.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "shared/limits.h"
#include "training/step_math.h"

namespace tg {
namespace {

constexpr float kFilterVariance = 0.2f;  // [px^2]
constexpr double kMargin = 0.15;         // of the image, a side
constexpr std::int64_t kGrain = 1024;
}  // namespace

std::vector<float> pixelSizes(const Dataset& dataset, const GaussianModel& model) {
  const std::vector<std::size_t> train = dataset.indices(false);
  std::vector<float> sizes(model.size(), 0.0f);
  parallelFor(static_cast<std::int64_t>(model.size()), kGrain, [&](std::int64_t i) {
    double smallest = 0;
    for (const std::size_t view : train) {
      const Camera& camera = dataset.views[view].camera;
      const glm::dvec3 mean =
          camera.camera_from_world_rotation * glm::dvec3(model.mean[i]) + camera.camera_from_world_translation;
      if (!(mean.z > kNear)) continue;
      const double x = mean.x / mean.z * camera.fx + camera.cx;
      const double y = mean.y / mean.z * camera.fy + camera.cy;
      if (std::abs(x / camera.width - 0.5) > 0.5 + kMargin || std::abs(y / camera.height - 0.5) > 0.5 + kMargin) {
        continue;
      }
      const double size = mean.z / std::max(camera.fx, camera.fy);
      if (smallest == 0 || size < smallest) smallest = size;
    }
    sizes[i] = static_cast<float>(smallest);
  });
  const float largest = sizes.empty() ? 0.0f : *std::max_element(sizes.begin(), sizes.end());
  std::replace(sizes.begin(), sizes.end(), 0.0f, largest);
  return sizes;
}

std::vector<float> minSigmas(const Dataset& dataset, const GaussianModel& model) {
  std::vector<float> sizes = pixelSizes(dataset, model);
  for (float& size : sizes) size *= std::sqrt(kFilterVariance);
  return sizes;
}

void applyFilter(const GaussianModel& model, std::span<const float> min_sigma, EffectiveParameters& out) {
  out.log_scale.resize(model.size());
  out.opacity_logit.resize(model.size());
  parallelFor(static_cast<std::int64_t>(model.size()), kGrain, [&](std::int64_t i) {
    const EffectiveGaussian effective = effectiveGaussian(model.log_scale[i], model.opacity_logit[i], min_sigma[i]);
    out.log_scale[i] = effective.log_scale;
    out.opacity_logit[i] = effective.opacity_logit;
  });
}

void filterGradient(const GaussianModel& model, std::span<const float> min_sigma, ModelGradient& gradient) {
  parallelFor(static_cast<std::int64_t>(model.size()), kGrain, [&](std::int64_t i) {
    filterGradientOf(model.log_scale[i], model.opacity_logit[i], min_sigma[i], gradient.v_log_scale[i],
                     gradient.v_opacity_logit[i]);
  });
}

}  // namespace tg
