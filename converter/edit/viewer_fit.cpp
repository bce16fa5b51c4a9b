// SPDX-License-Identifier: Apache-2.0
// A base made for somebody else's viewer.
#include "converter/edit/viewer_fit.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

#include "converter/gltf/axes.h"
#include "core/image/metrics.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "render/affine/affine_picture.h"
#include "render/renderer.h"
#include "shared/limits.h"
#include "shared/sh.h"

namespace tg {
namespace {

// Adam's steps at the start; they fall to a tenth.
constexpr float kRateOpacity = 0.05f;  // of the logit
constexpr float kRateColor = 0.01f;    // of the DC coefficient
constexpr float kRateScale = 0.01f;    // of ln(sigma)
constexpr float kRateMean = 0.01f;     // of the mean [sigma]
constexpr float kRateRest = 0.003f;    // of the other coefficients
constexpr float kMostLogit = 8.0f;
constexpr float kLeastSlope = 1e-11f;  // of the loss, below which steps get shorter
constexpr double kShownSide = 640;     // [px] of the longer side: nobody's window is smaller

struct Moments {
  float first = 0, second = 0;
  // The step for a gradient, of a rate of 1; none for one that no float holds.
  float step(float gradient, float bias1, float bias2) {
    if (!std::isfinite(gradient)) return 0.0f;
    first = 0.9f * first + 0.1f * gradient;
    second = 0.99f * second + 0.01f * gradient * gradient;
    return first / bias1 / (std::sqrt(second / bias2) + kLeastSlope);
  }
};

struct GaussianMoments {
  Moments opacity, color[3], scale[3], mean[3];
};

class Fit {
 public:
  Fit(GaussianModel& base, SplatViewer viewer, const FitSettings& settings)
      : base_(base), viewer_(viewer), settings_(settings), moments_(base.size()), rest_of_(base.size()) {
    std::size_t rest = 0;
    for (std::size_t i = 0; i < base.size(); ++i) {
      rest_of_[i] = rest;
      if (!isFixed(i)) rest += 3 * (base.shCount() - 1);
    }
    rest_.resize(rest);
  }

  void step(int number, const Camera& camera, const Image& picture, float shrink, glm::vec3 background) {
    const KeptSplats splats = keepSplats(base_, viewer_, false, settings_.parts);
    const AffineView view{camera, shrink * shrink};
    const std::vector<AffineSplat> seen = seenSplats(splats, viewer_, view);
    affineLoss(seen, viewer_, view, background, picture, gradients_);
    const float rate = std::pow(0.1f, static_cast<float>(number) / static_cast<float>(settings_.steps));
    const float bias1 = 1.0f - std::pow(0.9f, static_cast<float>(number + 1));
    const float bias2 = 1.0f - std::pow(0.99f, static_cast<float>(number + 1));
    parallelFor(static_cast<std::int64_t>(seen.size()), 256, [&](std::int64_t item) {
      const auto k = static_cast<std::size_t>(item);
      move(seen[k], gradients_[k], camera, rate, bias1, bias2);
    });
  }

 private:
  bool isFixed(std::size_t i) const { return i < settings_.fixed.size() && settings_.fixed[i] != 0; }

  void move(const AffineSplat& splat, const AffineGradient& gradient, const Pinhole& camera, float rate, float bias1,
            float bias2) {
    const std::size_t i = splat.gaussian;
    GaussianMoments& moments = moments_[i];
    float& logit = base_.opacity_logit[i];
    if (logit < -kMostLogit) return;
    const float opacity = sigmoidf(logit);
    logit -= rate * kRateOpacity * moments.opacity.step(gradient.opacity * opacity * (1.0f - opacity), bias1, bias2);
    logit = std::clamp(logit, -kMostLogit, kMostLogit);
    glm::vec3& dc = base_.sh[i * base_.shCount()];
    for (int c = 0; c < 3; ++c) {
      dc[c] -= rate * kRateColor * moments.color[c].step(gradient.color[c] * kShC0, bias1, bias2);
    }
    const bool fixed = isFixed(i);
    if (!fixed) {
      glm::vec4 basis[4];
      const glm::vec3 direction = glm::normalize(base_.mean[i] - glm::vec3(camera.position()));
      shBasis(direction, basis[0], basis[1], basis[2], basis[3]);
      Moments* rest = rest_.data() + rest_of_[i];
      for (std::size_t k = 1; k < base_.shCount(); ++k) {
        for (int c = 0; c < 3; ++c, ++rest) {
          const float slope = gradient.color[c] * basis[k / 4][static_cast<int>(k % 4)];
          (&dc)[k][c] -= rate * kRateRest * rest->step(slope, bias1, bias2);
        }
      }
    }
    const ScreenFromWorld screen = screenFromWorld(camera, base_.mean[i]);
    const glm::mat3 axes(matrixFromQuaternion(glm::dvec4(base_.rotation[i])));
    for (int axis = 0; axis < 3; ++axis) {
      float& log_scale = base_.log_scale[i][axis];
      const float sigma = std::exp(log_scale);
      const glm::vec2 a = sigma * glm::vec2(glm::dot(screen[0], axes[axis]), glm::dot(screen[1], axes[axis]));
      const float slope = 2.0f * glm::dot(gradient.covariance, glm::vec3(a.x * a.x, a.x * a.y, a.y * a.y));
      log_scale -= rate * kRateScale * moments.scale[axis].step(slope, bias1, bias2);
      if (fixed || !std::isfinite(sigma)) continue;
      const float shift = moments.mean[axis].step(glm::dot(gradient.center, a), bias1, bias2);
      base_.mean[i] -= rate * kRateMean * shift * sigma * axes[axis];
    }
  }

  GaussianModel& base_;
  const SplatViewer viewer_;
  const FitSettings settings_;
  std::vector<GaussianMoments> moments_;
  std::vector<std::size_t> rest_of_;  // where those of a Gaussian's other coefficients begin
  std::vector<Moments> rest_;
  std::vector<AffineGradient> gradients_;
};

}  // namespace

FitViews fitViews(const GaussianModel& model, std::span<const Camera> cameras, glm::vec3 background, int max_side) {
  const std::unique_ptr<Renderer> renderer = makeCpuRenderer();
  renderer->setModel(model);
  RenderSettings settings;
  settings.background = background;
  settings.outputs = {Output::final};
  FitViews views;
  views.background = background;
  for (const Camera& camera : cameras) {
    const double own = std::max(camera.size.x, camera.size.y), shown = std::max(own, kShownSide);
    const double shrink = std::min(1.0, max_side / shown);
    const glm::ivec2 size(glm::max(glm::dvec2(1.0), glm::round(shrink * shown / own * glm::dvec2(camera.size))));
    views.cameras.push_back(resized(camera, size.x, size.y));
    views.pictures.push_back(extract(renderer->render(views.cameras.back(), settings), Output::final));
    views.shrink.push_back(static_cast<float>(shrink));
  }
  return views;
}

double viewerPsnr(const GaussianModel& base, SplatViewer viewer, const FitViews& views,
                  std::span<const std::size_t> parts) {
  TG_ASSERT(!views.cameras.empty(), "a view at least");
  const ViewerPicture picture(base, viewer, parts);
  Image shown, wanted;
  for (std::size_t k = 0; k < views.cameras.size(); ++k) {
    const Image one = picture.render(views.cameras[k], views.background, views.shrink[k]);
    shown.data.insert(shown.data.end(), one.data.begin(), one.data.end());
    wanted.data.insert(wanted.data.end(), views.pictures[k].data.begin(), views.pictures[k].data.end());
  }
  for (Image* image : {&shown, &wanted}) {
    image->channels = 3;
    image->width = 1;
    image->height = static_cast<int>(image->data.size() / 3);
  }
  return psnr(shown, wanted);
}

void fitToViewer(GaussianModel& base, SplatViewer viewer, const FitViews& views, const FitSettings& settings,
                 const ConvertListener& listener) {
  TG_ASSERT(!views.cameras.empty(), "a view at least");
  Fit fit(base, viewer, settings);
  // Neighbours in the list are often neighbours in the room: far ones follow one another.
  const std::size_t count = views.cameras.size();
  std::size_t stride = std::max<std::size_t>(1, count * 2 / 5);
  while (std::gcd(stride, count) != 1) ++stride;
  const auto steps = static_cast<std::size_t>(settings.steps);
  if (listener) listener(ConvertPart::fit, 0, steps);
  for (int number = 0; number < settings.steps; ++number) {
    const std::size_t k = static_cast<std::size_t>(number) * stride % count;
    fit.step(number, views.cameras[k], views.pictures[k], views.shrink[k], views.background);
    if (listener) listener(ConvertPart::fit, static_cast<std::size_t>(number) + 1, steps);
  }
}

}  // namespace tg
