// SPDX-License-Identifier: Apache-2.0
// The models' formulas, their inverse, the rectangle that remains, and the resampling.
#include "training/data/lens.h"

#include <algorithm>
#include <cmath>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr double kLargestAngle = 1.55;  // [rad] from the axis, just short of the image plane's horizon
constexpr double kLeastRemains = 0.2;   // of a side
constexpr double kMostAdded = 0.5;      // of a side, on each end

double radialFactor(const Lens& lens, double r2) {
  if (lens.fov != 0) {
    const double r = std::sqrt(r2);
    const double slope = 2 * std::tan(lens.fov / 2);
    return r * slope < 1e-6 ? slope / lens.fov : std::atan(r * slope) / (r * lens.fov);
  }
  const auto& k = lens.radial;
  const auto& d = lens.radial_divisor;
  return (1 + r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * k[3])))) / (1 + r2 * (d[0] + r2 * (d[1] + r2 * d[2])));
}

double equidistant(double r) { return r < 1e-8 ? 1.0 : std::atan(r) / r; }

// Catmull-Rom weights of the pixels -1, 0, 1, 2 for a position `t` in [0, 1) between 0 and 1.
std::array<float, 4> catmullRom(float t) {
  const float t2 = t * t, t3 = t2 * t;
  return {-0.5f * t + t2 - 0.5f * t3, 1 - 2.5f * t2 + 1.5f * t3, 0.5f * t + 2 * t2 - 1.5f * t3, 0.5f * (t3 - t2)};
}

// Of the pixels that weigh at a position; `hidden(x, y)` says it of one.
template <typename Hidden>
bool hidesOne(int x, int y, const std::array<float, 4>& wx, const std::array<float, 4>& wy, const Hidden& hidden) {
  for (int v = 0; v < 4; ++v) {
    for (int u = 0; u < 4; ++u) {
      if (wx[u] * wy[v] != 0.0f && hidden(x + u - 1, y + v - 1)) return true;
    }
  }
  return false;
}

template <int kChannels>
void sample(const Image& from, int x, int y, const std::array<float, 4>& wx, const std::array<float, 4>& wy,
            float* result) {
  std::array<float, kChannels> sum{};
  for (int v = 0; v < 4; ++v) {
    const float* row =
        from.data.data() + static_cast<std::size_t>(std::clamp(y + v - 1, 0, from.height - 1)) * from.width * kChannels;
    for (int u = 0; u < 4; ++u) {
      const float weight = wx[u] * wy[v];
      const float* pixel = row + std::size_t{kChannels} * std::clamp(x + u - 1, 0, from.width - 1);
      for (int c = 0; c < kChannels; ++c) sum[c] += weight * pixel[c];
    }
  }
  for (int c = 0; c < kChannels; ++c) result[c] = std::clamp(sum[c], 0.0f, 1.0f);
}

void premultiply(Image& image) {
  if (image.channels != 4) return;
  for (std::size_t i = 0; i < image.data.size(); i += 4) {
    for (std::size_t c = 0; c < 3; ++c) image.data[i + c] *= image.data[i + 3];
  }
}
void unpremultiply(float* pixel) {
  for (int c = 0; c < 3; ++c) pixel[c] = pixel[3] > 0 ? std::min(pixel[c] / pixel[3], 1.0f) : 0.0f;
}

}  // namespace

bool Lens::isPinhole() const {
  const auto zero = [](const auto& values) { return std::ranges::all_of(values, [](double v) { return v == 0; }); };
  return !fisheye && fov == 0 && zero(radial) && zero(radial_divisor) && zero(tangential) && zero(thin_prism);
}

glm::dvec2 Lens::distort(glm::dvec2 p) const {
  if (fisheye) p *= equidistant(glm::length(p));
  const double r2 = glm::dot(p, p);
  const double xy = 2 * p.x * p.y;
  const glm::dvec2 shift(tangential[0] * xy + tangential[1] * (r2 + 2 * p.x * p.x) + thin_prism[0] * r2,
                         tangential[1] * xy + tangential[0] * (r2 + 2 * p.y * p.y) + thin_prism[1] * r2);
  return p * radialFactor(*this, r2) + shift;
}

double Lens::validRadius() const {
  constexpr int kSteps = 4000;
  double before = 0;
  for (int i = 1; i <= kSteps; ++i) {
    const double angle = kLargestAngle * i / kSteps;
    const double r = fisheye ? angle : std::tan(angle);
    const double bent = r * radialFactor(*this, r * r);
    if (!(bent > before)) return std::tan(kLargestAngle * (i - 1) / kSteps);
    before = bent;
  }
  return std::tan(kLargestAngle);
}

std::optional<glm::dvec2> Lens::undistort(glm::dvec2 distorted, double valid_radius) const {
  const double bent = glm::length(distorted);
  glm::dvec2 p = fisheye && bent > 0 ? distorted * (std::tan(std::min(bent, 1.4)) / bent) : distorted;
  if (glm::length(p) > valid_radius) p *= 0.9 * valid_radius / glm::length(p);
  for (int i = 0; i < 50; ++i) {
    const glm::dvec2 error = distort(p) - distorted;
    if (glm::length(error) < 1e-10) break;
    const double h = 1e-6 * std::max(1.0, glm::length(p));
    const glm::dvec2 by_x = (distort(p + glm::dvec2(h, 0)) - distort(p - glm::dvec2(h, 0))) / (2 * h);
    const glm::dvec2 by_y = (distort(p + glm::dvec2(0, h)) - distort(p - glm::dvec2(0, h))) / (2 * h);
    const double determinant = by_x.x * by_y.y - by_x.y * by_y.x;
    glm::dvec2 step((by_y.y * error.x - by_y.x * error.y) / determinant,
                    (by_x.x * error.y - by_x.y * error.x) / determinant);
    const double longest = 0.5 * std::max(0.1, glm::length(p));
    if (!(glm::length(step) <= longest)) step *= longest / glm::length(step);
    p -= step;
  }
  const bool found = glm::length(p) <= valid_radius && glm::length(distort(p) - distorted) < 1e-7;
  return found ? std::optional(p) : std::nullopt;
}

Undistortion::Undistortion(Lens of, const Camera& camera, const std::string& label)
    : lens(std::move(of)), distorted(camera), pinhole(camera), valid_radius(lens.validRadius()) {
  // Where the photograph's border lies for the pinhole: the innermost point of each side.
  const glm::dvec2 size(camera.size);
  glm::dvec2 low = -kMostAdded * size, high = (1 + kMostAdded) * size;
  constexpr int kPoints = 64;  // a side
  for (int i = 0; i <= kPoints; ++i) {
    const glm::dvec2 along = 0.5 + (size - 1.0) * (static_cast<double>(i) / kPoints);
    const auto seen = [&](glm::dvec2 pixel) -> std::optional<glm::dvec2> {
      const auto plane = lens.undistort(glm::dvec2(ray(camera, pixel)), valid_radius);
      return plane ? std::optional(project(camera, {*plane, 1.0})) : std::nullopt;
    };
    if (const auto left = seen({0.5, along.y})) low.x = std::max(low.x, left->x);
    if (const auto right = seen({size.x - 0.5, along.y})) high.x = std::min(high.x, right->x);
    if (const auto top = seen({along.x, 0.5})) low.y = std::max(low.y, top->y);
    if (const auto bottom = seen({along.x, size.y - 0.5})) high.y = std::min(high.y, bottom->y);
  }
  if (valid_radius <= 0) high = low;  // no ray but the middle one
  constexpr double kRounding = 1e-6;  // [px] a pinhole's borders are its own
  const glm::dvec2 first = glm::ceil(low - 0.5 - kRounding), last = glm::floor(high - 0.5 + kRounding);
  const glm::dvec2 remains = last - first + 1.0;
  const auto pixels = [](double side) {  // no less than none, where the side is not a number, too
    return std::to_string(static_cast<long long>(std::min(std::fmax(side, 0.0), 1e15)));
  };
  const auto text = [&](glm::dvec2 s) { return pixels(s.x) + " x " + pixels(s.y); };
  if (!(remains.x >= kLeastRemains * size.x && remains.y >= kLeastRemains * size.y)) {
    throw Error(ErrorKind::badData, label,
                "the lens distortion (" + lens.model +
                    ") is implausible (expected that undistorting keeps at least a "
                    "fifth of " +
                    text(size) + " pixels a side, found " + text(remains) + ")");
  }
  if (!(remains.x * remains.y <= static_cast<double>(kMaxImagePixels))) {
    throw Error(ErrorKind::badData, label,
                "too large once it is undistorted (expected at most " + std::to_string(kMaxImagePixels) +
                    " pixels, found " + text(remains) + ")");
  }
  origin = first;
  pinhole.size = remains;
  pinhole.center -= first;
}

Undistortion::Result Undistortion::apply(const Image& photograph,
                                         const std::vector<std::uint8_t>& photograph_mask) const {
  TG_ASSERT(photograph.width == distorted.size.x && photograph.height == distorted.size.y,
            "the photograph has its camera's size");
  TG_ASSERT(photograph_mask.empty() || photograph_mask.size() == static_cast<std::size_t>(photograph.width) *
                                                                     static_cast<std::size_t>(photograph.height),
            "a mask has the picture's size");
  Image straight;
  const Image* from = &photograph;
  if (photograph.channels == 4) {
    straight = photograph;
    premultiply(straight);
    from = &straight;
  }
  const int width = photograph.width, height = photograph.height;
  const auto hidden = [&](int x, int y) {
    return photograph_mask[static_cast<std::size_t>(std::clamp(y, 0, height - 1)) * width +
                           std::clamp(x, 0, width - 1)] == 0;
  };
  Result result{Image(pinhole.size.x, pinhole.size.y, photograph.channels), {}};
  result.mask.assign(static_cast<std::size_t>(pinhole.size.x) * pinhole.size.y, 255);
  parallelFor(pinhole.size.y, 8, [&](int y) {
    for (int x = 0; x < pinhole.size.x; ++x) {
      const glm::dvec2 plane(ray(pinhole, {x + 0.5, y + 0.5}));
      std::uint8_t& counts = result.mask[static_cast<std::size_t>(y) * pinhole.size.x + x];
      const glm::dvec2 at = project(distorted, {lens.distort(plane), 1.0}) - 0.5;
      if (!(glm::length(plane) <= valid_radius && at.x >= -0.5 && at.y >= -0.5 && at.x <= width - 0.5 &&
            at.y <= height - 0.5)) {
        counts = 0;
        continue;
      }
      const glm::dvec2 low = glm::floor(at);
      const int u = static_cast<int>(low.x), v = static_cast<int>(low.y);
      const auto wx = catmullRom(static_cast<float>(at.x - low.x)), wy = catmullRom(static_cast<float>(at.y - low.y));
      if (!photograph_mask.empty() && hidesOne(u, v, wx, wy, hidden)) counts = 0;
      float* pixel = &result.image.at(x, y, 0);
      if (photograph.channels == 1) sample<1>(*from, u, v, wx, wy, pixel);
      if (photograph.channels == 3) sample<3>(*from, u, v, wx, wy, pixel);
      if (photograph.channels == 4) {
        sample<4>(*from, u, v, wx, wy, pixel);
        unpremultiply(pixel);
      }
    }
  });
  return result;
}

}  // namespace tg
