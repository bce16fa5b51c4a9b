// SPDX-License-Identifier: Apache-2.0
// Untextured Gaussians as a viewer keeps them, and seen from a camera.
#include "render/affine/affine_splats.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "shared/limits.h"
#include "shared/sh.h"

namespace tg {
namespace {

constexpr std::int64_t kGrain = 512;
constexpr float kSphereBins = 4095;

// What a float is after it was stored in 16 bits; beyond their range infinite, below it 0.
float asHalf(float value) {
  const float magnitude = std::abs(value);
  if (magnitude >= 65520.0f) return std::copysign(std::numeric_limits<float>::infinity(), value);
  int exponent = 0;
  std::frexp(magnitude, &exponent);
  const float step = std::ldexp(1.0f, std::max(exponent - 11, -24));
  return std::copysign(std::nearbyint(magnitude / step) * step, value);
}

// In [low, high], in whole steps.
float inSteps(float value, float steps, float low, float high) {
  return std::floor(std::clamp(value, low, high) * steps + 0.5f) / steps;
}

Covariance covarianceOf(glm::vec4 rotation, glm::vec3 sigma) {
  const glm::vec4 q = glm::normalize(rotation);
  const float w = q.x, x = q.y, y = q.z, z = q.w;
  const glm::mat3 axes(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y),  //
                       2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x),  //
                       2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y));
  Covariance c{};
  for (int k = 0; k < 3; ++k) {
    const glm::vec3 a = axes[k] * sigma[k];
    c[0] += a.x * a.x, c[1] += a.x * a.y, c[2] += a.x * a.z;
    c[3] += a.y * a.y, c[4] += a.y * a.z, c[5] += a.z * a.z;
  }
  return c;
}

// PlayCanvas' work buffer: a third of a rotation in 11, 11 and 10 bits.
glm::vec4 inElevenBits(glm::vec4 rotation) {
  glm::vec4 q = glm::normalize(rotation);
  if (q.x < 0) q = -q;
  const float scale = 1.0f / std::sqrt(1.0f + q.x);
  glm::vec3 p(q.y * scale, q.z * scale, q.w * scale);
  for (int k = 0; k < 3; ++k) {
    const float steps = k < 2 ? 2047.0f : 1023.0f;
    p[k] = 2.0f * inSteps(0.5f * p[k] + 0.5f, steps, 0.0f, 1.0f) - 1.0f;
  }
  const float d = glm::dot(p, p);
  return {1.0f - d, std::sqrt(std::max(0.0f, 2.0f - d)) * p};
}

// Logarithms in so many steps over PlayCanvas' and Spark's 21 nats from -12 on.
glm::vec3 inLogSteps(glm::vec3 sigma, float steps) {
  for (int k = 0; k < 3; ++k) {
    const float code = std::clamp((std::log(sigma[k]) + 12.0f) * steps / 21.0f, 0.0f, steps);
    sigma[k] = std::exp(std::floor(code + 0.5f) * 21.0f / steps - 12.0f);
  }
  return sigma;
}

struct Stored {
  glm::vec3 mean, sigma;
  glm::vec4 rotation;
  float opacity;
};

void roundGeometry(SplatViewer viewer, Stored& splat) {
  splat.opacity = inSteps(splat.opacity, 255.0f, 0.0f, 1.0f);
  switch (viewer) {
    case SplatViewer::three:
    case SplatViewer::cesium:
      break;
    case SplatViewer::playcanvas:
      splat.rotation = inElevenBits(splat.rotation);
      splat.sigma = inLogSteps(splat.sigma, 255.0f);
      break;
    case SplatViewer::babylon:
      // The signs of a byte's quaternion depend on the file's axes: model and glTF differ by permuting and negating.
      splat.rotation = glm::normalize(splat.rotation);
      for (int k = 0; k < 4; ++k) {
        const float stored = splat.rotation[k] * 127.5f + 127.5f;
        splat.rotation[k] = (std::floor(std::clamp(stored + 0.5f, 0.0f, 255.0f)) - 127.5f) / 127.5f;
      }
      break;
    case SplatViewer::spark:
      for (int k = 0; k < 3; ++k) splat.mean[k] = asHalf(splat.mean[k]);
      splat.sigma = inLogSteps(splat.sigma, 254.0f);
      break;
  }
}

// Halves of the whole, or of a part of the largest entry.
void roundCovariance(SplatViewer viewer, Covariance& c) {
  if (viewer != SplatViewer::babylon && viewer != SplatViewer::cesium) return;
  float unit = 0.25f;  // Cesium keeps four times the covariance
  if (viewer == SplatViewer::babylon) {
    unit = 0;
    for (const float entry : c) unit = std::max(unit, std::abs(entry));
  }
  if (!(unit > 0)) return;
  for (float& entry : c) entry = asHalf(entry / unit) * unit;
}

void roundSh(SplatViewer viewer, glm::vec3* sh, std::size_t count) {
  const bool bytes = viewer == SplatViewer::three || viewer == SplatViewer::babylon;
  for (std::size_t k = 0; k < count; ++k) {
    for (int c = 0; c < 3; ++c) {
      float& value = sh[k][c];
      if (k == 0) {
        const float color = 0.5f + kShC0 * value;
        if (bytes || viewer == SplatViewer::cesium) value = (inSteps(color, 255.0f, 0.0f, 1.0f) - 0.5f) / kShC0;
      } else if (bytes) {
        value = (std::floor(std::clamp(value * 128.0f + 128.5f, 0.0f, 255.0f)) - 128.0f) / 128.0f;
      } else if (viewer == SplatViewer::cesium) {
        value = asHalf(value);
      }
    }
  }
}

// The sphere around three.js' box of a part's splats at the cut.
void addSphere(KeptSplats& splats, std::size_t begin, SplatPart& part, float cut) {
  glm::vec3 low(std::numeric_limits<float>::max()), high(-low);
  const auto reach = [&](std::size_t i) {
    const Covariance& c = splats.covariance[i];
    return cut * std::sqrt(std::max({c[0], c[3], c[5]}));
  };
  for (std::size_t i = begin; i < part.end; ++i) {
    low = glm::min(low, splats.mean[i] - reach(i));
    high = glm::max(high, splats.mean[i] + reach(i));
  }
  part.sphere_center = 0.5f * (low + high);
  for (std::size_t i = begin; i < part.end; ++i) {
    part.sphere_radius = std::max(part.sphere_radius, glm::distance(part.sphere_center, splats.mean[i]) + reach(i));
  }
}

// Bins instead of depths, as whole numbers.
void binDepths(std::vector<AffineSplat>& seen, const KeptSplats& splats, float near, const Pinhole& camera) {
  struct Bins {
    float low, scale;
  };
  std::vector<Bins> bins;
  for (const SplatPart& part : splats.parts) {
    const auto middle = static_cast<float>(cameraFromWorld(camera, part.sphere_center).z);
    const float low = std::max(near, middle - part.sphere_radius);
    bins.push_back({low, kSphereBins / std::max(middle + part.sphere_radius - low, 1e-4f)});
  }
  for (AffineSplat& splat : seen) {
    const auto [low, scale] = bins[splat.part];
    splat.depth = std::floor(std::clamp((splat.depth - low) * scale, 0.0f, kSphereBins));
  }
}

glm::vec3 colorOf(const KeptSplats& splats, std::size_t i, glm::vec3 direction) {
  const std::size_t count = shCountOf(splats.sh_degree);
  glm::vec4 basis[4];
  shBasis(direction, basis[0], basis[1], basis[2], basis[3]);
  glm::vec3 color(0.5f);
  for (std::size_t k = 0; k < count; ++k) color += basis[k / 4][static_cast<int>(k % 4)] * splats.sh[i * count + k];
  return color;
}

// Work of one Gaussian: false where it is not drawn.
class Projection {
 public:
  Projection(const KeptSplats& splats, SplatViewer viewer, const AffineView& view)
      : splats_(splats),
        viewer_(viewer),
        profile_(profileOf(viewer)),
        camera_(view.camera),
        blur_(profile_.blur * view.blur_scale),
        least_variance_(profile_.least_variance * view.blur_scale),
        least_reach_(profile_.least_reach * std::sqrt(view.blur_scale)),
        size_(camera_.size),
        eye_(camera_.position()) {
    most_reach_ = profile_.most_reach * std::sqrt(view.blur_scale);
    if (profile_.reach_in_picture) most_reach_ = std::min({most_reach_, size_.x, size_.y});
  }

  bool project(std::size_t i, AffineSplat& splat) const {
    const glm::vec3 mean = splats_.mean[i];
    const glm::vec3 in_camera(cameraFromWorld(camera_, mean));
    if (!(in_camera.z > profile_.near)) return false;
    splat.gaussian = static_cast<std::uint32_t>(i);
    splat.center = glm::vec2(tg::project(camera_, in_camera));
    if (!std::isfinite(splat.center.x + splat.center.y)) return false;
    const glm::vec2 from_middle = glm::abs(2.0f * splat.center / size_ - 1.0f);
    if (profile_.guard > 0 && !(std::max(from_middle.x, from_middle.y) <= profile_.guard)) return false;
    splat.depth = profile_.order == ViewerOrder::cameraRadius ? glm::distance(mean, eye_) : in_camera.z;
    return addShape(i, splat) && addColor(mean, splat);
  }

 private:
  bool addShape(std::size_t i, AffineSplat& splat) const {
    const ScreenFromWorld j = screenFromWorld(camera_, splats_.mean[i]);
    const Covariance& c = splats_.covariance[i];
    const auto times = [&](glm::vec3 v) {
      return glm::vec3(c[0] * v.x + c[1] * v.y + c[2] * v.z, c[1] * v.x + c[3] * v.y + c[4] * v.z,
                       c[2] * v.x + c[4] * v.y + c[5] * v.z);
    };
    const glm::vec3 s(glm::dot(j[0], times(j[0])), glm::dot(j[0], times(j[1])), glm::dot(j[1], times(j[1])));
    splat.covariance = s;
    const float xx = s.x + blur_, xy = s.y, yy = s.z + blur_;
    splat.opacity = splats_.opacity[i];
    if (profile_.compensated) {
      const float determinant = xx * yy - xy * xy;
      splat.compensation = std::sqrt(std::max((s.x * s.z - xy * xy) / std::max(determinant, 1e-6f), 0.0f));
      splat.opacity *= splat.compensation;
    }
    const float middle = 0.5f * (xx + yy);
    const float apart = std::hypot(0.5f * (xx - yy), xy);
    const float long_reach = profile_.cut * std::sqrt(middle + apart);
    const float short_reach = profile_.cut * std::sqrt(std::max({middle - apart, least_variance_, 1e-12f}));
    if (!std::isfinite(long_reach) || !(splat.opacity > profile_.least_alpha)) return false;
    if (std::max(long_reach, short_reach) < least_reach_) return false;
    const float angle = 0.5f * std::atan2(2.0f * xy, xx - yy);
    const glm::vec2 along(std::cos(angle), std::sin(angle)), across(-along.y, along.x);
    const float u = std::min(long_reach, most_reach_), v = std::min(short_reach, most_reach_);
    splat.axis_u = along / u;
    splat.axis_v = across / v;
    const glm::vec2 half = profile_.square ? u * glm::abs(along) + v * glm::abs(across)
                                           : glm::sqrt(u * u * along * along + v * v * across * across);
    const glm::vec2 low = glm::clamp(glm::floor(splat.center - half - 0.5f), glm::vec2(0.0f), size_);
    const glm::vec2 high = glm::clamp(glm::ceil(splat.center + half + 0.5f), glm::vec2(0.0f), size_);
    splat.box = glm::ivec4(low, high);
    return splat.box.x < splat.box.z && splat.box.y < splat.box.w;
  }

  bool addColor(glm::vec3 mean, AffineSplat& splat) const {
    const glm::vec3 color = colorOf(splats_, splat.gaussian, glm::normalize(mean - eye_));
    const float most = !profile_.premultiplied || viewer_ == SplatViewer::spark ? 1.0f : 4.0f;
    splat.color = glm::clamp(color, 0.0f, most);
    splat.color_clamped = glm::notEqual(splat.color, color);
    return true;
  }

  const KeptSplats& splats_;
  const SplatViewer viewer_;
  const ViewerProfile& profile_;
  const Pinhole& camera_;
  const float blur_, least_variance_, least_reach_;
  const glm::vec2 size_;
  const glm::vec3 eye_;
  float most_reach_ = 0;
};

}  // namespace

KeptSplats keepSplats(const GaussianModel& model, SplatViewer viewer, bool rounded,
                      std::span<const std::size_t> parts) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  KeptSplats splats;
  const std::size_t n = model.size(), count = model.shCount();
  splats.sh_degree = model.sh_degree;
  splats.mean = model.mean;
  splats.sh = model.sh;
  splats.covariance.resize(n);
  splats.opacity.resize(n);
  parallelFor(static_cast<std::int64_t>(n), kGrain, [&](std::int64_t item) {
    const auto i = static_cast<std::size_t>(item);
    Stored splat{model.mean[i], glm::exp(model.log_scale[i]), model.rotation[i], sigmoidf(model.opacity_logit[i])};
    if (rounded) {
      roundGeometry(viewer, splat);
      roundSh(viewer, splats.sh.data() + i * count, count);
    }
    splats.mean[i] = splat.mean;
    splats.opacity[i] = splat.opacity;
    splats.covariance[i] = covarianceOf(splat.rotation, splat.sigma);
    if (rounded) roundCovariance(viewer, splats.covariance[i]);
  });
  std::size_t begin = 0;
  for (std::size_t k = 0; k <= parts.size(); ++k) {
    SplatPart part{.end = k < parts.size() ? parts[k] : n};
    TG_ASSERT(part.end >= begin && part.end <= n, "parts ascend inside the model");
    if (profileOf(viewer).order == ViewerOrder::sphereBins) addSphere(splats, begin, part, profileOf(viewer).cut);
    begin = part.end;
    splats.parts.push_back(part);
  }
  return splats;
}

ScreenFromWorld screenFromWorld(const Pinhole& camera, glm::vec3 mean) {
  const glm::vec3 p(cameraFromWorld(camera, mean));
  const glm::mat3 from_camera = glm::transpose(glm::mat3(camera.rotation));
  const glm::vec2 focal = glm::vec2(camera.focal) / p.z;
  return {from_camera * glm::vec3(focal.x, 0.0f, -focal.x * p.x / p.z),
          from_camera * glm::vec3(0.0f, focal.y, -focal.y * p.y / p.z)};
}

std::vector<AffineSplat> seenSplats(const KeptSplats& splats, SplatViewer viewer, const AffineView& view) {
  const Projection projection(splats, viewer, view);
  std::vector<AffineSplat> all(splats.size());
  parallelFor(static_cast<std::int64_t>(all.size()), kGrain, [&](std::int64_t item) {
    const auto i = static_cast<std::size_t>(item);
    if (!projection.project(i, all[i])) all[i].box = {};
  });
  std::uint32_t part = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    while (i >= splats.parts[part].end) ++part;
    all[i].part = part;
  }
  std::erase_if(all, [](const AffineSplat& splat) { return splat.box.x >= splat.box.z; });
  const ViewerProfile& profile = profileOf(viewer);
  if (profile.order == ViewerOrder::sphereBins) binDepths(all, splats, profile.near, view.camera);
  std::ranges::stable_sort(all, [](const AffineSplat& a, const AffineSplat& b) {
    return a.part != b.part ? a.part < b.part : a.depth > b.depth;
  });
  return all;
}

}  // namespace tg
