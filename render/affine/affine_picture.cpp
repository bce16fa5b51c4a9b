// SPDX-License-Identifier: Apache-2.0
// The picture that somebody else's viewer makes of a model's base, and its derivative.
#include "render/affine/affine_picture.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/system/assert.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr int kBandRows = 8;                // [px] a thread's work
constexpr float kMostAlpha = 0.995f;        // of a derivative, which divides by what is left
constexpr float kLeastLeft = 1e-5f;         // transmittance below which a derivative ends, before divisions overflow
constexpr float kLeastSlope = 1e-6f;        // [1/px]
constexpr float kLeastDeterminant = 1e-6f;  // [px^4]

struct Falloff {
  explicit Falloff(const ViewerProfile& profile)
      : exponent(0.5f * profile.cut * profile.cut),
        end(profile.lifted ? std::exp(-exponent) : 0.0f),
        scale(1.0f / (1.0f - end)),
        square(profile.square) {}
  // Whether (u, v) is drawn.
  bool reaches(float u, float v) const {
    return square ? std::max(std::abs(u), std::abs(v)) <= 1.0f : u * u + v * v <= 1.0f;
  }
  float gaussian(float u, float v) const { return std::exp(-exponent * (u * u + v * v)); }
  float value(float gaussian) const { return (gaussian - end) * scale; }

  float exponent, end, scale;
  bool square;
};

// The splats that reach into each band of rows, in their order.
std::vector<std::vector<std::uint32_t>> bandsOf(std::span<const AffineSplat> seen, int height) {
  std::vector<std::vector<std::uint32_t>> bands(static_cast<std::size_t>((height + kBandRows - 1) / kBandRows));
  for (std::size_t k = 0; k < seen.size(); ++k) {
    for (int band = seen[k].box.y / kBandRows; band <= (seen[k].box.w - 1) / kBandRows; ++band) {
      bands[static_cast<std::size_t>(band)].push_back(static_cast<std::uint32_t>(k));
    }
  }
  return bands;
}

// Calls body(x, y, u, v) for the pixels of a splat's box in rows [top, bottom).
template <typename Body>
void forEachBoxPixel(const AffineSplat& splat, int top, int bottom, const Body& body) {
  for (int y = std::max(top, splat.box.y); y < std::min(bottom, splat.box.w); ++y) {
    const float dy = static_cast<float>(y) + 0.5f - splat.center.y;
    for (int x = splat.box.x; x < splat.box.z; ++x) {
      const float dx = static_cast<float>(x) + 0.5f - splat.center.x;
      body(x, y, splat.axis_u.x * dx + splat.axis_u.y * dy, splat.axis_v.x * dx + splat.axis_v.y * dy);
    }
  }
}

// The same for those that it draws.
template <typename Body>
void forEachPixel(const AffineSplat& splat, const Falloff& falloff, int top, int bottom, const Body& body) {
  forEachBoxPixel(splat, top, bottom, [&](int x, int y, float u, float v) {
    if (falloff.reaches(u, v)) body(x, y, u, v);
  });
}

float inBytes(float value) { return std::floor(std::min(value, 1.0f) * 255.0f + 0.5f) * (1.0f / 255.0f); }

void blendBand(std::span<const AffineSplat> seen, std::span<const std::uint32_t> band, const ViewerProfile& profile,
               int top, Image& picture) {
  const Falloff falloff(profile);
  const int bottom = std::min(top + kBandRows, picture.height);
  for (const std::uint32_t k : band) {
    const AffineSplat& splat = seen[k];
    forEachPixel(splat, falloff, top, bottom, [&](int x, int y, float u, float v) {
      const float alpha = splat.opacity * falloff.value(falloff.gaussian(u, v));
      if (alpha < profile.least_alpha) return;
      float* pixel = &picture.at(x, y, 0);
      for (int c = 0; c < 3; ++c) {
        const float light = profile.premultiplied ? std::min(splat.color[c] * alpha, 1.0f) : splat.color[c] * alpha;
        pixel[c] = inBytes(light + pixel[c] * (1.0f - alpha));
      }
    });
  }
}

// A pixel on its way back: what is drawn so far, front first.
struct Pixel {
  glm::vec3 color;  // of what is left behind
  glm::vec3 slope;  // dL/d(color) of the picture
  float transmittance;
};

float alphaOf(const AffineSplat& splat, const Falloff& falloff, float gaussian) {
  return std::min(splat.opacity * falloff.value(gaussian), kMostAlpha);
}

// Forward without rounding, then back; `gradients` are the band's own.
double deriveBand(std::span<const AffineSplat> seen, std::span<const std::uint32_t> band, const ViewerProfile& profile,
                  glm::vec3 background, int top, const Image& target, std::vector<AffineGradient>& gradients) {
  const Falloff falloff(profile);
  const int bottom = std::min(top + kBandRows, target.height);
  const auto width = static_cast<std::size_t>(target.width);
  std::vector<Pixel> pixels(width * static_cast<std::size_t>(bottom - top), {background, glm::vec3(0.0f), 1.0f});
  const auto pixelAt = [&](int x, int y) -> Pixel& {
    return pixels[static_cast<std::size_t>(y - top) * width + static_cast<std::size_t>(x)];
  };
  for (const std::uint32_t k : band) {
    forEachPixel(seen[k], falloff, top, bottom, [&](int x, int y, float u, float v) {
      Pixel& pixel = pixelAt(x, y);
      pixel.color = glm::mix(pixel.color, seen[k].color, alphaOf(seen[k], falloff, falloff.gaussian(u, v)));
    });
  }
  double loss = 0;
  const float per_value = 1.0f / static_cast<float>(target.data.size());
  for (int y = top; y < bottom; ++y) {
    for (int x = 0; x < target.width; ++x) {
      Pixel& pixel = pixelAt(x, y);
      const glm::vec3 difference = pixel.color - glm::vec3(target.at(x, y, 0), target.at(x, y, 1), target.at(x, y, 2));
      loss += static_cast<double>(glm::dot(difference, difference));
      pixel.slope = 2.0f * per_value * difference;
    }
  }
  for (std::size_t n = band.size(); n-- > 0;) {
    const AffineSplat& splat = seen[band[n]];
    AffineGradient& gradient = gradients[n];
    const float end_alpha = alphaOf(splat, falloff, std::exp(-falloff.exponent));
    forEachBoxPixel(splat, top, bottom, [&](int x, int y, float u, float v) {
      Pixel& pixel = pixelAt(x, y);
      if (pixel.transmittance < kLeastLeft) return;
      // The inverse covariance times the offset.
      const glm::vec2 w = 2.0f * falloff.exponent * (u * splat.axis_u + v * splat.axis_v);
      const glm::vec3 square(w.x * w.x, 2.0f * w.x * w.y, w.y * w.y);
      const bool drawn = falloff.reaches(u, v);
      // What the cut takes in as it moves: a ramp of two pixels in place of its step.
      const float slope = glm::length(w);
      const float apart = std::abs(falloff.exponent * (u * u + v * v - 1.0f)) / std::max(slope, kLeastSlope);
      const bool at_cut = end_alpha > 0 && apart < 1.0f;
      if (!drawn && !at_cut) return;
      const float gaussian = drawn ? falloff.gaussian(u, v) : 0.0f;
      const float alpha = drawn ? alphaOf(splat, falloff, gaussian) : 0.0f;
      pixel.color = (pixel.color - alpha * splat.color) / (1.0f - alpha);
      const float v_alpha = pixel.transmittance * glm::dot(splat.color - pixel.color, pixel.slope);
      if (at_cut) {
        const float edge = v_alpha * end_alpha * (1.0f - apart) / std::max(slope, kLeastSlope);
        gradient.covariance += 0.5f * edge * square;
        gradient.center += edge * w;
      }
      if (!drawn) return;
      gradient.color += pixel.transmittance * alpha * pixel.slope;
      pixel.transmittance *= 1.0f - alpha;
      if (alpha >= kMostAlpha) return;
      gradient.opacity += v_alpha * falloff.value(gaussian);
      gradient.center += v_alpha * splat.opacity * gaussian * falloff.scale * w;
      gradient.covariance += 0.5f * v_alpha * splat.opacity * gaussian * falloff.scale * square;
    });
  }
  return loss * static_cast<double>(per_value);
}

// Through what a viewer does between a splat and its ellipse.
void finishGradient(const AffineSplat& splat, const ViewerProfile& profile, float blur, AffineGradient& gradient) {
  for (int c = 0; c < 3; ++c) {
    if (splat.color_clamped[c]) gradient.color[c] = 0.0f;
  }
  if (!profile.compensated) return;
  const glm::vec3 s = splat.covariance;
  const float before = std::max(s.x * s.z - s.y * s.y, kLeastDeterminant);
  const float after = std::max((s.x + blur) * (s.z + blur) - s.y * s.y, kLeastDeterminant);
  // dL/d(log compensation) = dL/d(opacity) opacity, both as they are drawn.
  const float v_log = 0.5f * gradient.opacity * splat.opacity;
  gradient.covariance += v_log * glm::vec3(s.z / before - (s.z + blur) / after, 2.0f * s.y * (1 / after - 1 / before),
                                           s.x / before - (s.x + blur) / after);
  gradient.opacity *= splat.compensation;
}

}  // namespace

AffineGradient& AffineGradient::operator+=(const AffineGradient& other) {
  opacity += other.opacity;
  color += other.color;
  center += other.center;
  covariance += other.covariance;
  return *this;
}

ViewerPicture::ViewerPicture(const GaussianModel& base, SplatViewer viewer, std::span<const std::size_t> parts)
    : viewer_(viewer), splats_(keepSplats(base, viewer, true, parts)) {}

Image ViewerPicture::render(const Pinhole& camera, glm::vec3 background, float shrink) const {
  const std::vector<AffineSplat> seen = seenSplats(splats_, viewer_, {camera, shrink * shrink});
  Image picture(camera.size.x, camera.size.y, 3);
  for (std::size_t i = 0; i < picture.data.size(); ++i) {
    picture.data[i] = inBytes(std::max(background[static_cast<int>(i % 3)], 0.0f));
  }
  const auto bands = bandsOf(seen, picture.height);
  parallelFor(static_cast<std::int64_t>(bands.size()), 1, [&](std::int64_t band) {
    blendBand(seen, bands[static_cast<std::size_t>(band)], profileOf(viewer_), static_cast<int>(band) * kBandRows,
              picture);
  });
  return picture;
}

double affineLoss(std::span<const AffineSplat> seen, SplatViewer viewer, const AffineView& view, glm::vec3 background,
                  const Image& target, std::vector<AffineGradient>& gradients) {
  TG_ASSERT(target.channels == 3 && target.width == view.camera.size.x && target.height == view.camera.size.y,
            "the target is a picture of the camera");
  const ViewerProfile& profile = profileOf(viewer);
  const auto bands = bandsOf(seen, target.height);
  std::vector<std::vector<AffineGradient>> own(bands.size());
  std::vector<double> losses(bands.size());
  parallelFor(static_cast<std::int64_t>(bands.size()), 1, [&](std::int64_t item) {
    const auto band = static_cast<std::size_t>(item);
    own[band].resize(bands[band].size());
    losses[band] =
        deriveBand(seen, bands[band], profile, background, static_cast<int>(item) * kBandRows, target, own[band]);
  });
  gradients.assign(seen.size(), {});
  double loss = 0;
  for (std::size_t band = 0; band < bands.size(); ++band) {
    loss += losses[band];
    for (std::size_t n = 0; n < bands[band].size(); ++n) gradients[bands[band][n]] += own[band][n];
  }
  parallelFor(static_cast<std::int64_t>(seen.size()), 256, [&](std::int64_t k) {
    finishGradient(seen[static_cast<std::size_t>(k)], profile, profile.blur * view.blur_scale,
                   gradients[static_cast<std::size_t>(k)]);
  });
  return loss;
}

}  // namespace tg
