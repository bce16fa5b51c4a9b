// SPDX-License-Identifier: Apache-2.0
// What decides how many Gaussians there are and how small they may be, one Gaussian at a time: ADC, MCMC, 3D filter. In
// one text for the CPU and CUDA, as step_math.h.
#pragma once
#include <cstddef>
#include <cstdint>

#include "core/model/pinhole.h"
#include "core/model/verbs.h"
#include "shared/limits.h"
#include "shared/splat.h"
#include "training/settings/settings.h"
#include "core/system/random.h"
#include "training/step/step_math.h"

namespace tg {

// ---- Adaptive density control (densify.h)
struct DensifySettings {
  double extent = 1;              // [world units] sceneExtent()
  float score_threshold = 2e-4f;  // NDC gradient, mean over the views
  DensifyScore score = DensifyScore::sum;
  float clone_max_scale = 0.01f;  // of the extent: smaller Gaussians are cloned, larger ones split
  float split_shrink = 1.6f;      // children of a split are this much smaller
  float prune_opacity = 0.005f;
  bool prune_large = false;       // also what is larger than the next two allow
  float prune_scale = 0.1f;       // of the extent
  float prune_radius = 0;         // [px] on screen; 0: as wide as they like
  std::size_t max_gaussians = 0;  // 0: no limit. Under one, the highest scores grow first
};

struct DensifyResult {
  std::size_t pruned = 0;
  std::size_t cloned = 0;
  std::size_t split = 0;
};

constexpr float kResetOpacity = 0.01f;     // 3DGS
constexpr unsigned kNumbersOfASplit = 12;  // of a Random: two children, three axes, two for a normal()

TG_FN float largestScale(glm::vec3 log_scale) { return exp(max(max(log_scale.x, log_scale.y), log_scale.z)); }

TG_FN bool clonable(glm::vec3 log_scale, const DensifySettings& settings) {
  return largestScale(log_scale) <= settings.clone_max_scale * settings.extent;
}
// 3DGS grows first and prunes then: a Gaussian that is split goes if its children are too large. Its bound on the width
// on screen never holds there, since the widths are zeroed before they are read.
TG_FN bool prunable(float opacity_logit, glm::vec3 log_scale, float max_radius, bool grows,
                    const DensifySettings& settings) {
  if (sigmoidf(opacity_logit) < settings.prune_opacity) return true;
  if (!settings.prune_large) return false;
  const float shrink = grows && !clonable(log_scale, settings) ? settings.split_shrink : 1.0f;
  return largestScale(log_scale) / shrink > settings.prune_scale * settings.extent ||
         (settings.prune_radius > 0 && max_radius > settings.prune_radius);
}
// Of a Gaussian, over those that densify: 1 and more grows. quantile: the magnitude that as many Gaussians reach as
// pass the threshold (the rule of Gaussian Opacity Fields, Yu et al. 2024); 0: none passes.
TG_FN float growthScore(float score, float magnitude, float quantile, DensifyScore kind) {
  if (kind == DensifyScore::sum || !(quantile > 0)) return kind == DensifyScore::magnitudesOnly ? 0.0f : score;
  return kind == DensifyScore::magnitudesOnly ? magnitude / quantile : max(score, magnitude / quantile);
}
// 0 where no view saw it.
TG_FN float meanOverViews(float sum, std::uint32_t views) {
  return views == 0 ? 0.0f : sum / static_cast<float>(views);
}

// A point drawn from the Gaussian itself.
TG_FN glm::vec3 sampleGaussian(glm::vec3 mean, glm::vec4 rotation, glm::vec3 log_scale, Random& random) {
  glm::vec3 local;
  for (int axis = 0; axis < 3; ++axis) local[axis] = exp(log_scale[axis]) * static_cast<float>(random.normal());
  return mean + rotationFromQuaternion(rotation) * local;
}

// ---- Markov chain Monte Carlo (mcmc.h)
struct McmcSettings {
  std::size_t max_gaussians = 0;  // the cap
  float dead_opacity = 0.005f;    // at or below it a Gaussian is relocated
  float growth = 0.05f;           // of the count, a round
};

struct McmcResult {
  std::size_t relocated = 0;
  std::size_t added = 0;
};

constexpr int kMostShared = 50;  // N_max - 1 of the authors' code; binomials stay exact in double

// Opacity and scale factor of each of `count` equal Gaussians at one place that look like one of opacity `opacity`
// (docs/math.md 9a, 9b). count is capped at 50.
struct SharedGaussian {
  float opacity;
  float scale;
};
TG_FN SharedGaussian shareGaussian(float opacity, int count) {
  count = clamp(count, 1, kMostShared);
  const double o = clamp(static_cast<double>(opacity), 1e-6, 1 - 1e-6);
  const double shared = 1 - std::pow(1 - o, 1.0 / count);
  // The integral along a line through the centre of the sum of the blended shares, over one share's own.
  double denominator = 0;
  double binomial[kMostShared] = {};  // row i - 1 of Pascal's triangle
  for (int i = 1; i <= count; ++i) {
    for (int k = i - 1; k > 0; --k) binomial[k] = k == i - 1 ? 1 : binomial[k] + binomial[k - 1];
    binomial[0] = 1;
    double power = shared;
    for (int k = 0; k < i; ++k) {
      denominator += binomial[k] * (k % 2 == 0 ? 1 : -1) * power / sqrt(k + 1.0);
      power *= shared;
    }
  }
  return {static_cast<float>(shared), static_cast<float>(o / denominator)};
}

// One of `copies` Gaussians that end up at one place.
TG_FN void shareParameters(int copies, float dead_opacity, float& opacity_logit, glm::vec3& log_scale) {
  const SharedGaussian share = shareGaussian(static_cast<float>(sigmoid(opacity_logit)), copies);
  const float opacity = clamp(share.opacity, dead_opacity, 1 - 1e-6f);
  opacity_logit = log(opacity / (1 - opacity));
  log_scale += log(share.scale);
}

// ---- 3D filter (filter_3d.h)
constexpr float kFilterVariance = 0.2f;      // [px^2]
constexpr double kFilterImageMargin = 0.15;  // of the image, a side

// Size of a pixel at `mean` in the camera that sees it largest; 0: none sees it. [world units]
TG_FN float pixelSizeAt(glm::vec3 mean, const Pinhole* cameras, std::size_t count) {
  double smallest = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const Pinhole& camera = cameras[k];
    const glm::dvec3 at = cameraFromWorld(camera, mean);
    if (!(at.z > kNear)) continue;
    const glm::dvec2 pixel = project(camera, at);
    if (std::abs(pixel.x / camera.size.x - 0.5) > 0.5 + kFilterImageMargin ||
        std::abs(pixel.y / camera.size.y - 0.5) > 0.5 + kFilterImageMargin) {
      continue;
    }
    const double size = at.z / max(camera.focal.x, camera.focal.y);
    if (smallest == 0 || size < smallest) smallest = size;
  }
  return static_cast<float>(smallest);
}

}  // namespace tg
