// SPDX-License-Identifier: Apache-2.0
// One Gaussian at a time, in double precision where differences of near-equal sigmas matter.
#include "training/filter_3d.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "shared/limits.h"
#include "shared/splat.h"

namespace tg {
namespace {

constexpr float kFilterVariance = 0.2f;  // [px^2]
constexpr double kMargin = 0.15;         // of the image, a side
constexpr std::int64_t kGrain = 1024;
// Above it 1 - opacity is all rounding; below the least, the logit leaves float.
constexpr double kMostOpacity = 1 - 1e-6;
constexpr double kLeastOpacity = 1e-30;

double sigmoid(double logit) { return 1 / (1 + std::exp(-logit)); }

// sigma^2 / sigma_eff^2 of each stored axis.
glm::dvec3 keptShare(const GaussianModel& model, std::size_t i, double f) {
  const glm::dvec3 variance = glm::exp(2.0 * glm::dvec3(model.log_scale[i]));
  return variance / (variance + f * f);
}

// The effective opacity's factor.
double compensation(const GaussianModel& model, std::size_t i, glm::dvec3 kept) {
  const int c = shortestAxis(model.log_scale[i]);
  return std::sqrt(kept[axisU(c)] * kept[axisV(c)]);
}

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
    const glm::dvec3 kept = keptShare(model, i, min_sigma[i]);
    out.log_scale[i] = glm::vec3(glm::dvec3(model.log_scale[i]) - 0.5 * glm::log(kept));
    const double opacity =
        std::clamp(sigmoid(model.opacity_logit[i]) * compensation(model, i, kept), kLeastOpacity, kMostOpacity);
    out.opacity_logit[i] = static_cast<float>(std::log(opacity / (1 - opacity)));
  });
}

void filterGradient(const GaussianModel& model, std::span<const float> min_sigma, ModelGradient& gradient) {
  parallelFor(static_cast<std::int64_t>(model.size()), kGrain, [&](std::int64_t i) {
    const glm::dvec3 kept = keptShare(model, i, min_sigma[i]);
    const double opacity = std::min(sigmoid(model.opacity_logit[i]), kMostOpacity);
    const double effective = opacity * compensation(model, i, kept);
    // v_effective_logit / (1 - effective) = dL/d ln(effective opacity).
    const double v_log_opacity = gradient.v_opacity_logit[i] / (1 - effective);
    const int c = shortestAxis(model.log_scale[i]);
    for (const int axis : {0, 1, 2}) {
      double v = gradient.v_log_scale[i][axis] * kept[axis];
      if (axis != c) v += v_log_opacity * (1 - kept[axis]);
      gradient.v_log_scale[i][axis] = static_cast<float>(v);
    }
    gradient.v_opacity_logit[i] = static_cast<float>(v_log_opacity * (1 - opacity));
  });
}

}  // namespace tg
