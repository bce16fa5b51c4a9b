// SPDX-License-Identifier: Apache-2.0
// What the reference's forward and backward pass share: Gaussians seen from a camera, rays, and where the two meet.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "render/reference/reference.h"

namespace tg::reference {

// As floats, so that thresholds fall as in the float renderers: of the decimals (1 - 0.99)^2 is no less than 1e-4, and
// two opaque splats would not end a ray (docs/math.md 5).
constexpr double kAlphaMax = 0.99f;
constexpr double kAlphaMin = 1.0f / 255.0f;
constexpr double kTransmittanceStop = 1e-4f;
constexpr double kTextureExtent = 3.0;
constexpr double kPlaneMinCosine = 1e-9;
constexpr double kScaleMax = 1e18;
constexpr double kScreenVariance = 0.1;
constexpr double kEllipsoidAmbient = 0.25;
constexpr double kCenterRadius = 1.5;

// A Gaussian seen from the camera (docs/math.md 1.2, 2).
struct Splat {
  std::uint32_t gaussian = 0;
  double z = 0;             // camera z of the mean
  double opacity = 0;       // after opacity_scale and antialiasing
  int a = 0, b = 1, c = 2;  // local axes of u, of v, and the shortest one
  glm::dmat3 rotation;      // columns: local axes in world space
  glm::dvec3 scale;         // [world units] after splat_scale and antialiasing
  glm::dmat3 m;             // local_from_world, in sigma: diag(1 / scale) rotation^T
  glm::dvec3 o;             // the camera's position in the local frame
  glm::dvec3 normal;        // camera space, shortest axis turned to the camera
  glm::dvec3 direction;     // unit, world space, from the camera to the mean
  double distance = 0;      // from the camera to the mean
  glm::dvec3 base;          // max(0, SH + 0.5)
  glm::bvec3 base_clamped;
  TextureRect rect;              // 0 x 0 when no texture applies
  double texel_density = 0;      // [texels / px] at the mean
  double footprint = 0;          // share of the texture's mean in every sample
  glm::dvec4 texture_mean{0.0};  // under the Gaussian
};

// Columns are the Gaussian's local axes in world space. Quaternion w, x, y, z, of any length > 0.
glm::dmat3 rotationMatrix(glm::dvec4 quaternion);
// Which local axes are u, v and the shortest one (docs/math.md 2.2).
struct LocalAxes {
  int a, b, c;
};
LocalAxes localAxes(glm::dvec3 scale);

// What one frame needs, splats front to back.
struct Scene {
  const ReferenceModel& model;
  const Camera& camera;
  glm::dvec3 background;
  glm::dvec3 eye;  // camera position, world space
  bool texture_rgb = false;
  bool texture_alpha = false;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  TextureOutside outside = TextureOutside::base;
  SplatOrder order = SplatOrder::global;
  double near = 0;  // [world units]
  bool cutoffs = true;
  std::vector<Splat> splats{};
};
Scene makeScene(const ReferenceModel& model, const Camera& camera, const RenderSettings& settings,
                const ReferenceOptions& options);

// World-space ray direction through a pixel position [px], scaled so that the ray parameter is the camera z.
glm::dvec3 rayDirection(const Camera& camera, double x, double y);

// Real spherical harmonics 0..15 at a unit direction, and the gradient of each (docs/math.md 1.3).
std::array<double, 16> shBasis(glm::dvec3 direction);
std::array<glm::dvec3, 16> shBasisGradient(glm::dvec3 direction);

// Where a ray meets a splat: p is the point in the local frame.
struct Intersection {
  glm::dvec3 d;  // ray direction in the local frame
  glm::dvec3 p;
  double t = 0;
};
std::optional<Intersection> intersect(const Splat& splat, glm::dvec3 direction, IntersectionModel model, double near);

// Where a ray enters a Gaussian's surface at one sigma, before the near plane excepted.
struct Entry {
  double t = 0;
  glm::dvec3 normal;  // unit, world space, outwards
};
std::optional<Entry> enterEllipsoid(const Scene& scene, const Splat& splat, glm::dvec3 direction);

// A bilinear look-up at (u, v): four texels, their weights, the value, and its derivatives (docs/math.md 3).
struct TextureSample {
  double texel_u = 0, texel_v = 0;
  std::array<std::size_t, 4> texels{};
  std::array<double, 4> weights{};
  glm::dvec4 value{0.0}, du{0.0}, dv{0.0};
};
// Nothing when the splat has no texture or (u, v) lies outside it.
std::optional<TextureSample> sampleTexture(const ReferenceModel& model, const TextureRect& rect, double u, double v);

// What a ray meets of one splat (docs/math.md 5a), transmittance left at 1. Nothing when it misses, when its alpha is
// cut, or beyond the texture where TextureOutside::clip says so.
inline std::optional<ReferenceHit> hitSplat(const Scene& scene, const Splat& splat, glm::dvec3 direction) {
  const auto point = intersect(splat, direction, scene.intersection, scene.near);
  if (!point) return std::nullopt;
  ReferenceHit hit;
  hit.gaussian = splat.gaussian;
  hit.t = point->t;
  hit.u = point->p[splat.a];
  hit.v = point->p[splat.b];
  hit.value = std::exp(-0.5 * glm::dot(point->p, point->p));
  hit.base = splat.base;
  hit.texel_density = splat.texel_density;
  glm::dvec2 at(hit.u, hit.v);
  const bool beyond = std::max(std::abs(at.x), std::abs(at.y)) > kTextureExtent;
  if (beyond && splat.rect.texelCount() > 0) {
    if (scene.outside == TextureOutside::clip) return std::nullopt;
    if (scene.outside == TextureOutside::edge) at = glm::clamp(at, -kTextureExtent, kTextureExtent);
  }
  if (const auto sample = sampleTexture(scene.model, splat.rect, at.x, at.y)) {
    hit.texel_u = sample->texel_u;
    hit.texel_v = sample->texel_v;
    const glm::dvec4 value = glm::mix(sample->value, splat.texture_mean, splat.footprint);
    if (scene.texture_alpha) hit.texture_alpha = value.a;
    if (scene.texture_rgb) hit.texture = glm::dvec3(value);
  }
  hit.alpha = std::min(kAlphaMax, splat.opacity * hit.value * hit.texture_alpha);
  if (scene.cutoffs && hit.alpha < kAlphaMin) return std::nullopt;
  return hit;
}

// Calls visit(splat, hit) for every blended splat along a ray, front to back (docs/math.md 5). Returns the
// transmittance that is left.
template <typename Visit>
double blend(const Scene& scene, glm::dvec3 direction, const Visit& visit) {
  double transmittance = 1.0;
  const auto put = [&](const Splat& splat, ReferenceHit hit) {
    const double next = transmittance * (1.0 - hit.alpha);
    if (scene.cutoffs && next < kTransmittanceStop) return false;
    hit.transmittance = transmittance;
    visit(splat, hit);
    transmittance = next;
    return true;
  };
  if (scene.order == SplatOrder::global) {
    for (const Splat& splat : scene.splats) {
      const auto hit = hitSplat(scene, splat, direction);
      if (hit && !put(splat, *hit)) break;
    }
    return transmittance;
  }
  std::vector<std::pair<const Splat*, ReferenceHit>> hits;
  for (const Splat& splat : scene.splats) {
    if (const auto hit = hitSplat(scene, splat, direction)) hits.emplace_back(&splat, *hit);
  }
  std::stable_sort(hits.begin(), hits.end(), [](const auto& x, const auto& y) { return x.second.t < y.second.t; });
  for (const auto& [splat, hit] : hits) {
    if (!put(*splat, hit)) break;
  }
  return transmittance;
}

}  // namespace tg::reference
