// SPDX-License-Identifier: Apache-2.0
// The oracle's backward pass: docs/math.md 6, in the order of its steps.
#include <string>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "render/reference/reference.h"
#include "render/reference/splat.h"

namespace tg {
namespace {

using reference::Scene;
using reference::Splat;

// What the pixels of a band of rows add to one splat; parameters follow from these sums once per splat.
struct SplatSums {
  glm::dvec3 v_o{0.0};  // dL/d(camera position in the local frame)
  glm::dmat3 v_m{0.0};  // dL/d(local_from_world)
  double v_opacity = 0;
  glm::dvec3 v_base{0.0};
  glm::dvec2 screen{0.0};
  double screen_abs = 0;

  void operator+=(const SplatSums& other) {
    v_o += other.v_o;
    v_m += other.v_m;
    v_opacity += other.v_opacity;
    v_base += other.v_base;
    screen += other.screen;
    screen_abs += other.screen_abs;
  }
};

struct Sums {
  std::vector<SplatSums> splats;  // as Scene::splats
  std::vector<glm::dvec4> texels;
};

// One blended splat of a pixel, remembered for the walk back.
struct Blended {
  std::size_t splat = 0;
  ReferenceHit hit;
};

// dL/d(local ray) of one hit from dL/dp (docs/math.md 6.4).
struct RayGradient {
  glm::dvec3 v_o, v_d;
};
RayGradient rayGradient(const Splat& splat, const reference::Intersection& at, glm::dvec3 v_p,
                        IntersectionModel model) {
  if (model == IntersectionModel::plane) {
    glm::dvec3 v_o = v_p;
    v_o[splat.c] = -(v_p[splat.a] * at.d[splat.a] + v_p[splat.b] * at.d[splat.b]) / at.d[splat.c];
    return {v_o, at.t * v_o};
  }
  const double k = glm::dot(v_p, at.d) / glm::dot(at.d, at.d);
  const glm::dvec3 v_o = v_p - k * at.d;
  return {v_o, at.t * v_o - k * at.p};
}

// Adds one hit's share to the sums. v_color: dL/d(colour of the splat); v_alpha: dL/d(its alpha).
void addHit(const Scene& scene, const ReferenceOptions& options, const Blended& blended, glm::dvec3 direction,
            glm::dvec3 v_color, double v_alpha, Sums& sums) {
  const Splat& splat = scene.splats[blended.splat];
  const ReferenceHit& hit = blended.hit;
  SplatSums& sum = sums.splats[blended.splat];
  const auto at = *reference::intersect(splat, direction, scene.intersection, scene.near);
  sum.v_base += v_color;

  const bool clamped = splat.opacity * hit.value * hit.texture_alpha >= reference::kAlphaMax;
  if (clamped) v_alpha = 0.0;
  sum.v_opacity += v_alpha * hit.value * hit.texture_alpha;
  const double v_value = v_alpha * splat.opacity * hit.texture_alpha;
  glm::dvec3 v_p = -v_value * hit.value * at.p;

  if (const auto sample = reference::sampleTexture(scene.model, splat.rect, hit.u, hit.v)) {
    glm::dvec4 v_sample(0.0);
    if (scene.texture_rgb) v_sample = glm::dvec4(v_color, 0.0);
    if (scene.texture_alpha) v_sample.a = v_alpha * splat.opacity * hit.value;
    for (int k = 0; k < 4; ++k) sums.texels[sample->texels[k]] += sample->weights[k] * v_sample;
    if (options.texture_to_geometry) {
      v_p[splat.a] += glm::dot(v_sample, sample->du);
      v_p[splat.b] += glm::dot(v_sample, sample->dv);
    }
  }

  const RayGradient ray = rayGradient(splat, at, v_p, scene.intersection);
  const glm::dvec3 eye_from_mean = scene.eye - scene.model.mean[splat.gaussian];
  sum.v_o += ray.v_o;
  sum.v_m += glm::outerProduct(ray.v_o, eye_from_mean) + glm::outerProduct(ray.v_d, direction);

  const Camera& camera = scene.camera;
  const glm::dvec3 v_mean_c = -camera.rotation * (glm::transpose(splat.m) * ray.v_o);
  const glm::dvec2 e(v_mean_c.x * splat.z / camera.focal.x * camera.size.x / 2,
                     v_mean_c.y * splat.z / camera.focal.y * camera.size.y / 2);
  sum.screen += e;
  sum.screen_abs += glm::length(e);
}

void addPixel(const Scene& scene, const ReferenceOptions& options, int x, int y, glm::dvec3 v_color,
              std::vector<Blended>& list, Sums& sums) {
  const glm::dvec3 direction = reference::rayDirection(scene.camera, x + 0.5, y + 0.5);
  list.clear();
  const double transmittance = reference::blend(scene, direction, [&](const Splat& splat, const ReferenceHit& hit) {
    list.push_back({static_cast<std::size_t>(&splat - scene.splats.data()), hit});
  });
  glm::dvec3 behind = scene.background * transmittance;  // all that reaches the pixel from behind the hit
  for (auto it = list.rbegin(); it != list.rend(); ++it) {
    const ReferenceHit& hit = it->hit;
    const glm::dvec3 color = hit.base + hit.texture;
    const double weight = hit.transmittance * hit.alpha;
    const double v_alpha = glm::dot(v_color, hit.transmittance * color - behind / (1.0 - hit.alpha));
    addHit(scene, options, *it, direction, weight * v_color, v_alpha, sums);
    behind += weight * (options.texture_in_suffix ? color : hit.base);
  }
}

// dL/d(raw quaternion) from dL/d(rotation matrix) (docs/math.md 6.7).
glm::dvec4 quaternionGradient(glm::dvec4 raw, const glm::dmat3& v_rotation) {
  const double length = glm::length(raw);
  const glm::dvec4 q = raw / length;
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const auto g = [&](int row, int column) { return v_rotation[column][row]; };
  const glm::dvec4 v_q(
      2 * (z * (g(1, 0) - g(0, 1)) + y * (g(0, 2) - g(2, 0)) + x * (g(2, 1) - g(1, 2))),
      2 * (-2 * x * (g(1, 1) + g(2, 2)) + y * (g(1, 0) + g(0, 1)) + z * (g(2, 0) + g(0, 2)) + w * (g(2, 1) - g(1, 2))),
      2 * (x * (g(1, 0) + g(0, 1)) - 2 * y * (g(0, 0) + g(2, 2)) + z * (g(2, 1) + g(1, 2)) + w * (g(0, 2) - g(2, 0))),
      2 * (x * (g(2, 0) + g(0, 2)) + y * (g(2, 1) + g(1, 2)) - 2 * z * (g(0, 0) + g(1, 1)) + w * (g(1, 0) - g(0, 1))));
  return (v_q - q * glm::dot(q, v_q)) / length;
}

// The chain from a splat's sums to the stored parameters of its Gaussian (docs/math.md 6.6 to 6.8).
void finish(const Scene& scene, const Splat& splat, const SplatSums& sum, ReferenceGradient& gradient) {
  const ReferenceModel& model = scene.model;
  const std::uint32_t i = splat.gaussian;
  gradient.mean[i] = -glm::transpose(splat.m) * sum.v_o;
  glm::dmat3 v_rotation(0.0);
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) {
      gradient.log_scale[i][k] -= sum.v_m[j][k] * splat.m[j][k];
      v_rotation[k][j] = sum.v_m[j][k] / splat.scale[k];
    }
  }
  gradient.rotation[i] = quaternionGradient(model.rotation[i], v_rotation);
  gradient.opacity_logit[i] = sum.v_opacity * splat.opacity * (1.0 - splat.opacity);

  const glm::dvec3 v_base = glm::mix(sum.v_base, glm::dvec3(0.0), splat.base_clamped);
  const auto basis = reference::shBasis(splat.direction);
  const auto basis_gradient = reference::shBasisGradient(splat.direction);
  glm::dvec3 v_direction(0.0);
  for (std::size_t k = 0; k < model.shCount(); ++k) {
    const std::size_t at = std::size_t{i} * model.shCount() + k;
    gradient.sh[at] = basis[k] * v_base;
    v_direction += basis_gradient[k] * glm::dot(model.sh[at], v_base);
  }
  gradient.mean[i] += (v_direction - splat.direction * glm::dot(splat.direction, v_direction)) / splat.distance;
  gradient.screen[i] = sum.screen;
  gradient.screen_abs[i] = sum.screen_abs;
}

}  // namespace

ReferenceGradient backwardReference(const ReferenceModel& model, const Camera& camera, const RenderSettings& settings,
                                    std::span<const glm::dvec3> v_color, const ReferenceOptions& options) {
  TG_ASSERT(v_color.size() == static_cast<std::size_t>(camera.size.x) * static_cast<std::size_t>(camera.size.y),
            "a derivative a pixel");
  TG_ASSERT(model.rects.empty() || model.rects.size() == model.size(), "a rectangle a Gaussian, or none");
  requireBlendingDefaults(settings, settings.outputs, "the backward pass");
  const Scene scene = reference::makeScene(model, camera, settings, options);
  requireDifferentiable(scene.outside, "the backward pass");

  // Bands of rows, their number fixed: every sum is taken in one order whatever the number of threads.
  constexpr int kBands = 16;
  std::vector<Sums> bands(kBands);
  parallelFor(kBands, 1, [&](std::int64_t band) {
    Sums& sums = bands[band];
    sums.splats.resize(scene.splats.size());
    sums.texels.resize(model.texels.size(), glm::dvec4(0.0));
    std::vector<Blended> list;
    const int end = static_cast<int>(camera.size.y * (band + 1) / kBands);
    for (int y = static_cast<int>(camera.size.y * band / kBands); y < end; ++y) {
      for (int x = 0; x < camera.size.x; ++x) {
        addPixel(scene, options, x, y, v_color[static_cast<std::size_t>(y) * camera.size.x + x], list, sums);
      }
    }
  });

  ReferenceGradient gradient;
  forEachParameter([](const Field&, auto& v, const auto& values) { v.resize(values.size()); }, gradient, model);
  gradient.screen.resize(model.size(), glm::dvec2(0.0));
  gradient.screen_abs.resize(model.size(), 0.0);
  for (std::size_t k = 0; k < scene.splats.size(); ++k) {
    SplatSums total;
    for (const Sums& band : bands) total += band.splats[k];
    finish(scene, scene.splats[k], total, gradient);
  }
  for (const Sums& band : bands) {
    for (std::size_t k = 0; k < band.texels.size(); ++k) gradient.texels[k] += band.texels[k];
  }
  return gradient;
}

}  // namespace tg
