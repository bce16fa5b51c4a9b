// SPDX-License-Identifier: Apache-2.0
// The reference's walk along one ray, over those Gaussians only that the ray can meet.
#include "render/reference/inspect.h"

#include <algorithm>
#include <cmath>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "render/reference/reference.h"
#include "render/reference/splat.h"

namespace tg {
namespace {

// Gaussians whose sphere around all that can be seen of them meets the ray, ascending. The sphere holds the ellipsoid
// of the visible radius, antialiased or not; the margin covers float rounding of exp.
std::vector<std::uint32_t> nearRay(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                                   glm::dvec3 direction) {
  constexpr std::size_t kChunk = 16384;
  constexpr double kRadius = 3.33 * 1.001;  // [sigma] sqrt(2 ln 255): the most an opacity of 1 shows
  const glm::dvec3 eye = camera.position();
  const glm::dvec3 along = glm::normalize(direction);
  // At distance s from the eye a pixel is at most s / focal; its share of the widened sigma follows.
  const double spread = settings.antialiasing == Antialiasing::screen
                            ? std::sqrt(reference::kScreenVariance) / std::max(camera.focal.x, camera.focal.y)
                            : 0.0;
  const std::size_t chunks = (model.size() + kChunk - 1) / kChunk;
  std::vector<std::vector<std::uint32_t>> found(chunks);
  parallelFor(static_cast<std::int64_t>(chunks), 1, [&](std::int64_t chunk) {
    const std::size_t begin = static_cast<std::size_t>(chunk) * kChunk;
    const std::size_t end = std::min(model.size(), begin + kChunk);
    for (std::size_t i = begin; i < end; ++i) {
      const glm::dvec3 from_eye = glm::dvec3(model.mean[i]) - eye;
      const glm::dvec3 off_ray = glm::cross(from_eye, along);
      const glm::vec3 log_scale = model.log_scale[i];
      const double sigma = settings.splat_scale * std::exp(std::max({log_scale.x, log_scale.y, log_scale.z}));
      const double reach = kRadius * (sigma + spread * glm::length(from_eye));
      // Not "beyond": numbers that overflow stay in.
      if (!(glm::dot(off_ray, off_ray) > reach * reach)) found[chunk].push_back(static_cast<std::uint32_t>(i));
    }
  });
  std::vector<std::uint32_t> all;
  for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
  return all;
}

}  // namespace

std::vector<PixelHit> inspectPixel(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                                   glm::ivec2 pixel) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  const double x = pixel.x + 0.5;
  const double y = pixel.y + 0.5;
  checkSettings(settings);
  const auto candidates = nearRay(model, camera, settings, reference::rayDirection(camera, x, y));
  const ReferenceModel part(select(model, candidates));
  std::vector<PixelHit> hits;
  for (const ReferenceHit& hit : traceReference(part, camera, settings, x, y)) {
    hits.push_back({candidates[hit.gaussian],
                    hit.t,
                    hit.value,
                    {hit.u, hit.v},
                    hit.texture_alpha,
                    hit.alpha,
                    hit.transmittance,
                    hit.transmittance * hit.alpha,
                    hit.base,
                    hit.texture});
  }
  return hits;
}

std::array<glm::dvec3, 4> textureSquare(const GaussianModel& model, std::size_t index, double splat_scale) {
  TG_ASSERT(index < model.size(), "the model has this Gaussian");
  TG_ASSERT(splat_scale > 0.0, "a scale above 0");
  const glm::dvec3 scale = splat_scale * sigmaOf(model, index);
  const glm::dmat3 rotation = reference::rotationMatrix(model.rotation[index]);
  const reference::LocalAxes axes = reference::localAxes(scale);
  const glm::dvec3 mean = model.mean[index];
  const glm::dvec3 u = reference::kTextureExtent * scale[axes.a] * rotation[axes.a];
  const glm::dvec3 v = reference::kTextureExtent * scale[axes.b] * rotation[axes.b];
  return {mean - u - v, mean + u - v, mean + u + v, mean - u + v};
}

}  // namespace tg
