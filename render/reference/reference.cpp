// SPDX-License-Identifier: Apache-2.0
// The oracle's forward pass.
#include "render/reference/reference.h"

#include <limits>

#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "render/reference/splat.h"

namespace tg {

ReferenceModel::ReferenceModel(const GaussianModel& model)
    : sh_degree(model.sh_degree),
      texture_mode(model.texture_mode),
      intersection(model.intersection),
      outside(model.outside),
      rects(model.atlas.rects) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  forEachParameter([](const Field&, auto& to, const auto& from) { to.assign(from.begin(), from.end()); }, *this, model);
}

namespace {

// The outputs that blending yields, of one pixel.
void blendPixel(const reference::Scene& scene, glm::dvec3 direction, std::size_t pixel, FrameT<double>& frame) {
  glm::dvec3 base(0.0), texture(0.0), normal(0.0);
  double weight_sum = 0.0, weighted_t = 0.0, count = 0.0, median = 0.0;
  double textured_weight = 0.0, weighted_density = 0.0;
  const auto visit = [&](const reference::Splat& splat, const ReferenceHit& hit) {
    const double weight = hit.transmittance * hit.alpha;
    base += weight * hit.base;
    texture += weight * hit.texture;
    normal += weight * splat.normal;
    count += 1.0;
    weighted_t += weight * hit.t;
    weight_sum += weight;
    if (hit.transmittance >= 0.5 && hit.transmittance * (1.0 - hit.alpha) < 0.5) median = hit.t;
    if (splat.rect.texelCount() > 0) {
      textured_weight += weight;
      weighted_density += weight * hit.texel_density;
    }
  };
  const double transmittance = reference::blend(scene, direction, visit);
  base += transmittance * scene.background;
  const auto put = [&](auto& pixels, auto value) {
    if (!pixels.empty()) pixels[pixel] = value;
  };
  put(frame.picture, base + texture);
  put(frame.base, base);
  put(frame.texture, texture);
  put(frame.alpha, 1.0 - transmittance);
  put(frame.depth, weight_sum > 0.0 ? weighted_t / weight_sum : 0.0);
  put(frame.normal, normal);
  put(frame.count, count);
  put(frame.depth_median, median);
  put(frame.texel_density, textured_weight > 0.0 ? weighted_density / textured_weight : 0.0);
}

double overdraw(const reference::Scene& scene, glm::dvec3 direction) {
  double count = 0.0;
  for (const reference::Splat& splat : scene.splats) {
    const auto hit = reference::hitSplat(scene, splat, direction);
    if (hit && hit->alpha >= reference::kAlphaMin) count += 1.0;
  }
  return count;
}

glm::dvec3 ellipsoidColor(const reference::Scene& scene, glm::dvec3 direction) {
  glm::dvec3 color = scene.background;
  double nearest = std::numeric_limits<double>::infinity();
  for (const reference::Splat& splat : scene.splats) {
    const auto entry = reference::enterEllipsoid(scene, splat, direction);
    if (!entry || entry->t >= nearest) continue;
    nearest = entry->t;
    const double lambert = -glm::dot(entry->normal, glm::normalize(direction));
    color = splat.base * glm::mix(reference::kEllipsoidAmbient, 1.0, lambert);
  }
  return color;
}

glm::dvec3 centerColor(const reference::Scene& scene, glm::dvec2 position) {
  for (const reference::Splat& splat : scene.splats) {  // the nearest mean first
    const glm::dvec3 mean_c = cameraFromWorld(scene.camera, scene.model.mean[splat.gaussian]);
    if (glm::distance(project(scene.camera, mean_c), position) <= reference::kCenterRadius) return splat.base;
  }
  return scene.background;
}

}  // namespace

FrameT<double> renderReference(const ReferenceModel& model, const Camera& camera, const RenderSettings& settings,
                               const ReferenceOptions& options) {
  const reference::Scene scene = reference::makeScene(model, camera, settings, options);
  FrameT<double> frame(camera.size.x, camera.size.y, settings.outputs);
  parallelFor(camera.size.y, 1, [&](std::int64_t y) {
    for (int x = 0; x < camera.size.x; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * camera.size.x + x;
      const glm::dvec2 position(x + 0.5, static_cast<double>(y) + 0.5);
      const glm::dvec3 direction = reference::rayDirection(camera, position.x, position.y);
      if (settings.outputs.hasAny(kOrderedOutputs)) {
        blendPixel(scene, direction, pixel, frame);
      }
      if (!frame.overdraw.empty()) frame.overdraw[pixel] = overdraw(scene, direction);
      if (!frame.ellipsoids.empty()) frame.ellipsoids[pixel] = ellipsoidColor(scene, direction);
      if (!frame.centers.empty()) frame.centers[pixel] = centerColor(scene, position);
    }
  });
  return frame;
}

std::vector<ReferenceHit> traceReference(const ReferenceModel& model, const Camera& camera,
                                         const RenderSettings& settings, double pixel_x, double pixel_y,
                                         const ReferenceOptions& options) {
  const reference::Scene scene = reference::makeScene(model, camera, settings, options);
  std::vector<ReferenceHit> hits;
  reference::blend(scene, reference::rayDirection(camera, pixel_x, pixel_y),
                   [&](const reference::Splat&, const ReferenceHit& hit) { hits.push_back(hit); });
  return hits;
}

}  // namespace tg
