// SPDX-License-Identifier: Apache-2.0
// The oracle's forward pass.
#include "render/reference/reference.h"

#include "core/parallel.h"
#include "render/reference/splat.h"

namespace tg {

ReferenceModel::ReferenceModel(const GaussianModel& model)
    : mean(model.mean.begin(), model.mean.end()),
      rotation(model.rotation.begin(), model.rotation.end()),
      log_scale(model.log_scale.begin(), model.log_scale.end()),
      opacity_logit(model.opacity_logit.begin(), model.opacity_logit.end()),
      sh(model.sh.begin(), model.sh.end()),
      sh_degree(model.sh_degree),
      texture_mode(model.texture_mode),
      intersection(model.intersection),
      rects(model.atlas.rects),
      texels(model.atlas.texels.begin(), model.atlas.texels.end()) {}

FrameT<double> renderReference(const ReferenceModel& model, const Camera& camera, const RenderSettings& settings,
                               const ReferenceOptions& options) {
  const reference::Scene scene = reference::makeScene(model, camera, settings, options);
  FrameT<double> frame(camera.width, camera.height);
  parallelFor(camera.height, 1, [&](std::int64_t y) {
    for (int x = 0; x < camera.width; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * camera.width + x;
      double weight_sum = 0.0;
      double weighted_t = 0.0;
      const auto direction = reference::rayDirection(camera, x + 0.5, y + 0.5);
      const auto visit = [&](const reference::Splat& splat, const ReferenceHit& hit) {
        const double weight = hit.transmittance * hit.alpha;
        frame.base[pixel] += weight * hit.base;
        frame.texture[pixel] += weight * hit.texture;
        frame.normal[pixel] += weight * splat.normal;
        frame.count[pixel] += 1.0;
        weighted_t += weight * hit.t;
        weight_sum += weight;
      };
      const double transmittance = reference::blend(scene, direction, visit);
      frame.base[pixel] += transmittance * scene.background;
      frame.alpha[pixel] = 1.0 - transmittance;
      frame.depth[pixel] = weight_sum > 0.0 ? weighted_t / weight_sum : 0.0;
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
