// SPDX-License-Identifier: Apache-2.0
// How much a written file differs from its source, seen through a few cameras.
#include "converter/edit/quality.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "converter/gltf/axes.h"
#include "core/image/image.h"
#include "core/image/metrics.h"
#include "core/model/verbs.h"
#include "core/model/views.h"
#include "core/system/assert.h"
#include "core/system/median.h"
#include "render/contribution.h"
#include "render/renderer.h"
#include "shared/limits.h"

namespace tg {
namespace {

constexpr std::size_t kQualityViews = 4;
constexpr int kQualitySide = 256;  // [px]
constexpr std::size_t kContributionViews = 24;
constexpr int kContributionSide = 160;  // [px]
constexpr double kRingFov = 50.0 * M_PI / 180.0;
constexpr double kRingLift = 0.35;  // height of the ring over the centre, as a part of its radius
constexpr double kNearest = 1e-6;   // [world units] of a ring around nothing
constexpr double kResolved = 1e-9;  // of a place's distance from the origin: what a camera's numbers still tell apart
constexpr double kFarthest = 1e38;  // [world units] floats reach so far
constexpr double kTrim = 0.05;      // of the means at either end of an axis: floaters do not set the distance
constexpr double kNearPart = 0.2;   // of how near the median Gaussian comes to a view that has it in its picture

Camera shrunk(const Camera& camera, int max_side) {
  TG_ASSERT(max_side >= 1, "a picture has pixels");
  const double factor = std::min(1.0, static_cast<double>(max_side) / std::max(camera.size.x, camera.size.y));
  return resized(camera, std::max(1, static_cast<int>(std::lround(camera.size.x * factor))),
                 std::max(1, static_cast<int>(std::lround(camera.size.y * factor))));
}

// The means between the trimmed ends of each axis.
void trimmedBounds(const GaussianModel& model, glm::dvec3& low, glm::dvec3& high) {
  std::vector<float> values(model.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < model.size(); ++i) values[i] = model.mean[i][axis];
    const auto at = [&](double part) {
      const auto nth = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
      std::nth_element(values.begin(), nth, values.end());
      return static_cast<double>(*nth);
    };
    low[axis] = at(kTrim);
    high[axis] = at(1.0 - kTrim);
  }
}

// Evenly spaced ones of the model's own cameras, or a ring around it.
std::vector<Camera> evenViews(const GaussianModel& model, std::span<const Camera> cameras, std::size_t max_views,
                              int max_side) {
  std::vector<Camera> views;
  for (const Camera& camera : evenly(cameras, max_views)) views.push_back(shrunk(camera, max_side));
  if (!views.empty()) return views;

  glm::dvec3 low(0.0), high(0.0), sigma(0.0);
  if (model.size() > 0) {
    trimmedBounds(model, low, high);
    sigma = sigmaOf(model, 0);
  }
  const glm::dvec3 center = 0.5 * (low + high);
  double radius = 0.5 * glm::length(high - low);
  if (radius == 0.0) radius = 3.0 * glm::max(sigma.x, sigma.y);
  const double distance =
      std::clamp(radius / std::sin(0.5 * kRingFov), std::max(kNearest, kResolved * glm::length(center)), kFarthest);
  for (std::size_t i = 0; i < max_views; ++i) {
    const double angle = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(max_views);
    const glm::dvec3 direction = glm::normalize(glm::dvec3(std::sin(angle), -kRingLift, -std::cos(angle)));
    views.push_back(lookAt(center + distance * direction, center, glm::dvec3(0, -1, 0), kRingFov, max_side, max_side));
  }
  return views;
}

}  // namespace

std::vector<Camera> qualityViews(const GaussianModel& model, std::span<const Camera> cameras) {
  return evenViews(model, cameras, kQualityViews, kQualitySide);
}

std::vector<Camera> contributionViews(const GaussianModel& model, std::span<const Camera> cameras) {
  return evenViews(model, cameras, viewsForAll(model.mean, cameras, kContributionViews), kContributionSide);
}

float nearOf(const GaussianModel& model, std::span<const Camera> views) {
  std::vector<double> nearest;
  for (const Sighting& sighting : sightings(model.mean, views)) {
    if (sighting.views > 0) nearest.push_back(sighting.nearest);
  }
  if (nearest.empty()) return kNear;
  const auto near = static_cast<float>(kNearPart * medianOf(std::move(nearest)));
  return std::clamp(near, std::numeric_limits<float>::min(), kNear);
}

bool showsNothing(const GaussianModel& model, std::span<const Camera> views) {
  const std::vector<double> weights = blendWeights(model, views, nearOf(model, views));
  return std::ranges::none_of(weights, [](double weight) { return weight > 0; });
}

double renderedPsnr(const GaussianModel& a, const GaussianModel& b, std::span<const Camera> views,
                    glm::vec3 background) {
  TG_ASSERT(!views.empty(), "a view at least");
  const std::unique_ptr<Renderer> renderer_a = makeCpuRenderer();
  const std::unique_ptr<Renderer> renderer_b = makeCpuRenderer();
  renderer_a->setModel(a);
  renderer_b->setModel(b);
  RenderSettings settings;
  settings.background = background;
  settings.outputs = {Output::final};
  settings.near = nearOf(a, views);
  // All views as one tall image: views of any size count by their pixels.
  Image all_a, all_b;
  for (const Camera& view : views) {
    const Image image_a = extract(renderer_a->render(view, settings), Output::final);
    const Image image_b = extract(renderer_b->render(view, settings), Output::final);
    all_a.data.insert(all_a.data.end(), image_a.data.begin(), image_a.data.end());
    all_b.data.insert(all_b.data.end(), image_b.data.begin(), image_b.data.end());
  }
  for (Image* image : {&all_a, &all_b}) {
    image->channels = 3;
    image->width = 1;
    image->height = static_cast<int>(image->data.size() / 3);
  }
  return psnr(all_a, all_b);
}

bool isMeasuredUnasked(const GaussianModel& model) { return bytesOf(model) <= std::uint64_t{1} << 29; }

std::optional<Deviation> deviationOf(const GaussianModel& a, const GaussianModel& b) {
  TG_ASSERT(lengthsAgree(a) && lengthsAgree(b), "the model's arrays have their lengths");
  if (a.size() != b.size()) return std::nullopt;
  Deviation d;
  const auto covariance = [](const GaussianModel& m, std::size_t i) {
    glm::dmat3 axes = matrixFromQuaternion(glm::dvec4(m.rotation[i]));
    const glm::dvec3 sigma = sigmaOf(m, i);
    for (int k = 0; k < 3; ++k) axes[k] *= sigma[k];
    return axes * glm::transpose(axes);
  };
  const auto norm = [](const glm::dmat3& m) {
    return std::sqrt(glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]));
  };
  const auto raise = [](double& largest, glm::dvec3 difference) {
    for (int c = 0; c < 3; ++c) largest = std::max(largest, std::abs(difference[c]));
  };
  const std::size_t ka = a.shCount(), kb = b.shCount();
  const bool textures = a.texture_mode == b.texture_mode && a.texture_mode != TextureMode::none;
  for (std::size_t i = 0; i < a.size(); ++i) {
    raise(d.mean, glm::dvec3(a.mean[i]) - glm::dvec3(b.mean[i]));
    if (a.rotation[i] != b.rotation[i] || a.log_scale[i] != b.log_scale[i]) {
      const glm::dmat3 sa = covariance(a, i), sb = covariance(b, i);
      d.shape = std::max(d.shape, norm(sa - sb) / std::max({norm(sa), norm(sb), 1e-300}));
    }
    d.opacity = std::max(d.opacity, std::abs(opacityOf(a, i) - opacityOf(b, i)));
    raise(d.color, double{kShC0} * (glm::dvec3(a.sh[i * ka]) - glm::dvec3(b.sh[i * kb])));
    for (std::size_t k = 1; k < std::min(ka, kb); ++k) {
      raise(d.sh, glm::dvec3(a.sh[i * ka + k]) - glm::dvec3(b.sh[i * kb + k]));
    }
    if (!textures || a.atlas.rects.empty() || b.atlas.rects.empty()) continue;
    const TextureRect& ra = a.atlas.rects[i];
    const TextureRect& rb = b.atlas.rects[i];
    if (ra.width != rb.width || ra.height != rb.height) continue;
    for (std::uint32_t t = 0; t < ra.texelCount(); ++t) {
      const glm::dvec4 difference(glm::dvec4(a.atlas.texels[ra.offset + t]) -
                                  glm::dvec4(b.atlas.texels[rb.offset + t]));
      if (hasColor(a.texture_mode)) raise(d.texel, glm::dvec3(difference));
      if (hasAlpha(a.texture_mode)) d.texel = std::max(d.texel, std::abs(difference.a));
    }
  }
  return d;
}

}  // namespace tg
