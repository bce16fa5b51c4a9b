// SPDX-License-Identifier: Apache-2.0
// Gaussians seen from a camera, in float64: docs/math.md 1 to 3, one formula a line.
#include "render/reference/splat.h"

#include <algorithm>
#include <cmath>

namespace tg::reference {
namespace {

glm::dmat3 localFromWorld(const glm::dmat3& rotation, glm::dvec3 scale) {
  glm::dmat3 m;
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) m[j][k] = rotation[k][j] / scale[k];
  }
  return m;
}

// Whether a ray lies in the plane of a Gaussian. d: its direction in the local frame [sigma].
bool inPlane(const Splat& s, glm::dvec3 d) { return std::abs(d[s.c]) * s.scale[s.c] < kPlaneMinCosine; }

// The area of the Gaussian's shadow in the direction of the eye, up to a factor that its scale does not change.
double shadow(const Splat& s, glm::dvec3 scale, glm::dvec3 eye_from_mean, IntersectionModel model) {
  if (model == IntersectionModel::plane) return scale[s.a] * scale[s.b];
  return scale.x * scale.y * scale.z * glm::length(localFromWorld(s.rotation, scale) * eye_from_mean);
}

// docs/math.md 1.4
void antialias(const Camera& camera, glm::dvec3 eye_from_mean, IntersectionModel model, Splat& s) {
  const double pixel = s.z / std::max(camera.focal.x, camera.focal.y);
  const glm::dvec3 wider = glm::sqrt(s.scale * s.scale + kScreenVariance * pixel * pixel);
  s.opacity *= shadow(s, s.scale, eye_from_mean, model) / shadow(s, wider, eye_from_mean, model);
  s.scale = wider;
}

// How far a hit at the mean moves in the local frame for one pixel along `step` (docs/math.md 3.1).
glm::dvec3 moveOfHit(const Splat& s, glm::dvec3 step, IntersectionModel model) {
  const glm::dvec3 d = s.o / -s.z;
  const glm::dvec3 dd = s.m * step;
  const double along = model == IntersectionModel::plane ? dd[s.c] / d[s.c] : glm::dot(d, dd) / glm::dot(d, d);
  return s.z * (dd - along * d);
}

double texelDensity(const Scene& scene, const Splat& s) {
  if (s.rect.texelCount() == 0) return 0.0;
  if (scene.intersection == IntersectionModel::plane && inPlane(s, s.o / -s.z)) return 0.0;
  const glm::dmat3 world_from_camera = glm::transpose(scene.camera.rotation);
  const glm::dvec3 x = moveOfHit(s, world_from_camera[0] / scene.camera.focal.x, scene.intersection);
  const glm::dvec3 y = moveOfHit(s, world_from_camera[1] / scene.camera.focal.y, scene.intersection);
  const double texels = (s.rect.width - 1) * (s.rect.height - 1) / (4 * kTextureExtent * kTextureExtent);
  return std::sqrt(texels * std::abs(x[s.a] * y[s.b] - x[s.b] * y[s.a]));
}

// The mean of a texture under its Gaussian.
glm::dvec4 textureMean(const ReferenceModel& model, const TextureRect& rect) {
  const std::vector<double> across = texelShares(rect.width);
  const std::vector<double> down = texelShares(rect.height);
  glm::dvec4 mean(0.0);
  for (std::size_t j = 0; j < down.size(); ++j) {
    for (std::size_t i = 0; i < across.size(); ++i) {
      mean += across[i] * down[j] * model.texels[rect.offset + j * rect.width + i];
    }
  }
  return mean;
}

bool inside(const CropBox& box, glm::dvec3 x) {
  return glm::all(glm::lessThanEqual(glm::dvec3(box.min), x)) && glm::all(glm::lessThanEqual(x, glm::dvec3(box.max)));
}

Splat makeSplat(const Scene& scene, const RenderSettings& settings, std::uint32_t i) {
  const ReferenceModel& model = scene.model;
  const glm::dvec3 mean_c = cameraFromWorld(scene.camera, model.mean[i]);
  Splat s;
  s.gaussian = i;
  s.z = mean_c.z;
  s.opacity = std::min(1.0, settings.opacity_scale / (1.0 + std::exp(-model.opacity_logit[i])));
  s.rotation = rotationMatrix(model.rotation[i]);
  s.scale = double{settings.splat_scale} * glm::exp(model.log_scale[i]);
  const double longest = std::min(std::max({s.scale.x, s.scale.y, s.scale.z}), kScaleMax);
  s.scale = glm::clamp(s.scale, kThinnest * longest, longest);
  const LocalAxes axes = localAxes(model.log_scale[i]);
  s.a = axes.a;
  s.b = axes.b;
  s.c = axes.c;
  if (settings.antialiasing == Antialiasing::screen) {
    antialias(scene.camera, scene.eye - model.mean[i], scene.intersection, s);
  }
  s.m = localFromWorld(s.rotation, s.scale);
  s.o = s.m * (scene.eye - model.mean[i]);
  s.normal = scene.camera.rotation * s.rotation[s.c];
  if (glm::dot(s.normal, mean_c) > 0.0) s.normal = -s.normal;
  s.distance = glm::length(model.mean[i] - scene.eye);
  s.direction = (model.mean[i] - scene.eye) / s.distance;
  const auto basis = shBasis(s.direction);
  const int bands = std::min(model.sh_degree, settings.max_sh_degree) + 1;
  glm::dvec3 color(0.5);
  for (int k = 0; k < bands * bands; ++k) color += basis[k] * model.sh[std::size_t{i} * model.shCount() + k];
  s.base_clamped = glm::lessThanEqual(color, glm::dvec3(0.0));
  s.base = glm::max(color, glm::dvec3(0.0));
  if (!model.rects.empty() && (scene.texture_rgb || scene.texture_alpha)) s.rect = model.rects[i];
  s.texel_density = texelDensity(scene, s);
  if (settings.texture_filter == TextureFilter::footprint && s.rect.texelCount() > 0) {
    s.footprint = std::clamp(std::log2(s.texel_density), 0.0, 1.0);
    s.texture_mean = textureMean(model, s.rect);
  }
  return s;
}

}  // namespace

glm::dmat3 rotationMatrix(glm::dvec4 quaternion) {
  const glm::dvec4 q = quaternion / glm::length(quaternion);
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const glm::dvec3 r0(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y));
  const glm::dvec3 r1(2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x));
  const glm::dvec3 r2(2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y));
  return {r0, r1, r2};
}

LocalAxes localAxes(glm::dvec3 scale) {
  int c = 0;
  for (int k = 1; k < 3; ++k) {
    if (scale[k] < scale[c]) c = k;
  }
  return {c == 0 ? 1 : 0, c == 2 ? 1 : 2, c};
}

Scene makeScene(const ReferenceModel& model, const Camera& camera, const RenderSettings& settings,
                const ReferenceOptions& options) {
  const unsigned mode = static_cast<unsigned>(model.texture_mode) & static_cast<unsigned>(settings.textures);
  checkSettings(settings);
  Scene scene{model, camera, glm::dvec3(settings.background), camera.position()};
  scene.texture_alpha = (mode & static_cast<unsigned>(TextureMode::alpha)) != 0;
  scene.texture_rgb = (mode & static_cast<unsigned>(TextureMode::rgb)) != 0;
  scene.intersection = settings.intersection.value_or(model.intersection);
  scene.outside = settings.outside.value_or(model.outside);
  scene.order = settings.order;
  scene.near = settings.near;
  scene.cutoffs = options.cutoffs;
  for (std::uint32_t i = 0; i < model.size(); ++i) {
    if (cameraFromWorld(camera, model.mean[i]).z <= scene.near) continue;
    if (settings.crop && !inside(*settings.crop, model.mean[i])) continue;
    const Splat splat = makeSplat(scene, settings, i);
    if (splat.opacity * 255.0 > 1.0) scene.splats.push_back(splat);
  }
  // Depths are compared as float, as every other renderer does, so that ties fall alike: lower index first.
  std::stable_sort(scene.splats.begin(), scene.splats.end(),
                   [](const Splat& x, const Splat& y) { return static_cast<float>(x.z) < static_cast<float>(y.z); });
  return scene;
}

glm::dvec3 rayDirection(const Camera& camera, double x, double y) {
  return glm::transpose(camera.rotation) * ray(camera, {x, y});
}

std::array<double, 16> shBasis(glm::dvec3 direction) {
  const double pi = 3.14159265358979323846;
  const double x = direction.x, y = direction.y, z = direction.z;
  const double c0 = std::sqrt(1 / (4 * pi)), c1 = std::sqrt(3 / (4 * pi));
  const double c2 = std::sqrt(15 / (4 * pi)), c20 = std::sqrt(5 / (16 * pi));
  const double c30 = std::sqrt(7 / (16 * pi)), c31 = std::sqrt(21 / (32 * pi));
  const double c32 = std::sqrt(105 / (4 * pi)), c33 = std::sqrt(35 / (32 * pi));
  return {c0,
          -c1 * y,
          c1 * z,
          -c1 * x,
          c2 * x * y,
          -c2 * y * z,
          c20 * (2 * z * z - x * x - y * y),
          -c2 * x * z,
          c2 / 2 * (x * x - y * y),
          -c33 * y * (3 * x * x - y * y),
          c32 * x * y * z,
          -c31 * y * (4 * z * z - x * x - y * y),
          c30 * z * (2 * z * z - 3 * x * x - 3 * y * y),
          -c31 * x * (4 * z * z - x * x - y * y),
          c32 / 2 * z * (x * x - y * y),
          -c33 * x * (x * x - 3 * y * y)};
}

std::array<glm::dvec3, 16> shBasisGradient(glm::dvec3 direction) {
  const double pi = 3.14159265358979323846;
  const double x = direction.x, y = direction.y, z = direction.z;
  const double c1 = std::sqrt(3 / (4 * pi));
  const double c2 = std::sqrt(15 / (4 * pi)), c20 = std::sqrt(5 / (16 * pi));
  const double c30 = std::sqrt(7 / (16 * pi)), c31 = std::sqrt(21 / (32 * pi));
  const double c32 = std::sqrt(105 / (4 * pi)), c33 = std::sqrt(35 / (32 * pi));
  using glm::dvec3;
  return {dvec3(0.0),
          -c1 * dvec3(0, 1, 0),
          c1 * dvec3(0, 0, 1),
          -c1 * dvec3(1, 0, 0),
          c2 * dvec3(y, x, 0),
          -c2 * dvec3(0, z, y),
          c20 * dvec3(-2 * x, -2 * y, 4 * z),
          -c2 * dvec3(z, 0, x),
          c2 * dvec3(x, -y, 0),
          -c33 * dvec3(6 * x * y, 3 * x * x - 3 * y * y, 0),
          c32 * dvec3(y * z, x * z, x * y),
          -c31 * dvec3(-2 * x * y, 4 * z * z - x * x - 3 * y * y, 8 * y * z),
          c30 * dvec3(-6 * x * z, -6 * y * z, 6 * z * z - 3 * x * x - 3 * y * y),
          -c31 * dvec3(4 * z * z - 3 * x * x - y * y, -2 * x * y, 8 * x * z),
          c32 * dvec3(x * z, -y * z, (x * x - y * y) / 2),
          -c33 * dvec3(3 * x * x - 3 * y * y, -6 * x * y, 0)};
}

std::optional<Intersection> intersect(const Splat& splat, glm::dvec3 direction, IntersectionModel model, double near) {
  const glm::dvec3 o = splat.o;
  const glm::dvec3 d = splat.m * direction;
  Intersection hit;
  hit.d = d;
  if (model == IntersectionModel::plane) {
    if (inPlane(splat, d)) return std::nullopt;
    hit.t = -o[splat.c] / d[splat.c];
    hit.p = o + hit.t * d;
    hit.p[splat.c] = 0.0;
  } else {
    hit.t = -glm::dot(o, d) / glm::dot(d, d);
    hit.p = o + hit.t * d;
  }
  if (hit.t <= near) return std::nullopt;
  return hit;
}

std::optional<Entry> enterEllipsoid(const Scene& scene, const Splat& splat, glm::dvec3 direction) {
  const glm::dvec3 o = splat.o;
  const glm::dvec3 d = splat.m * direction;
  const double dd = glm::dot(d, d);
  const double middle = -glm::dot(o, d) / dd;
  const glm::dvec3 nearest = o + middle * d;
  const double square = (1.0 - glm::dot(nearest, nearest)) / dd;
  if (square < 0.0) return std::nullopt;
  Entry entry;
  entry.t = middle - std::sqrt(square);
  if (entry.t <= scene.near) return std::nullopt;
  entry.normal = glm::normalize(glm::transpose(splat.m) * (o + entry.t * d));
  return entry;
}

std::optional<TextureSample> sampleTexture(const ReferenceModel& model, const TextureRect& rect, double u, double v) {
  if (rect.width == 0 || rect.height == 0) return std::nullopt;
  if (std::abs(u) > kTextureExtent || std::abs(v) > kTextureExtent) return std::nullopt;
  const int width = rect.width, height = rect.height;
  const double scale_u = (width - 1) / (2 * kTextureExtent);
  const double scale_v = (height - 1) / (2 * kTextureExtent);
  TextureSample s;
  s.texel_u = (u + kTextureExtent) * scale_u;
  s.texel_v = (v + kTextureExtent) * scale_v;
  const int i0 = std::clamp(static_cast<int>(std::floor(s.texel_u)), 0, std::max(width - 2, 0));
  const int j0 = std::clamp(static_cast<int>(std::floor(s.texel_v)), 0, std::max(height - 2, 0));
  const int i1 = std::min(i0 + 1, width - 1);
  const int j1 = std::min(j0 + 1, height - 1);
  const double fu = s.texel_u - i0;
  const double fv = s.texel_v - j0;
  const auto at = [&](int i, int j) { return std::size_t{rect.offset} + static_cast<std::size_t>(j) * width + i; };
  s.texels = {at(i0, j0), at(i1, j0), at(i0, j1), at(i1, j1)};
  s.weights = {(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv};
  std::array<glm::dvec4, 4> value;
  for (int k = 0; k < 4; ++k) value[k] = model.texels[s.texels[k]];
  for (int k = 0; k < 4; ++k) s.value += s.weights[k] * value[k];
  s.du = scale_u * ((1 - fv) * (value[1] - value[0]) + fv * (value[3] - value[2]));
  s.dv = scale_v * ((1 - fu) * (value[2] - value[0]) + fu * (value[3] - value[1]));
  return s;
}

}  // namespace tg::reference
