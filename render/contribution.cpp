// SPDX-License-Identifier: Apache-2.0
// How much of a model's pictures each of its Gaussians is.
#include "render/contribution.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "shared/limits.h"
#include "shared/splat.h"
#include "shared/texture.h"

namespace tg {
namespace {

constexpr std::size_t kViewsAtATime = 16;  // each has weights of its own until they are added up

struct Projected {
  std::uint32_t gaussian = 0;
  Splat splat;
  glm::ivec4 box{0};  // pixels x0 <= x < x1, y0 <= y < y1
};

std::vector<Projected> project(const GaussianModel& model, const Camera& camera, float near) {
  const glm::mat3 rotation(camera.rotation);
  const glm::vec4 focal_center = focalCenter(camera);
  std::vector<Projected> projected;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const glm::vec3 mean(cameraFromWorld(camera, model.mean[i]));
    const float opacity = sigmoidf(model.opacity_logit[i]);
    const float radius = visibleRadius(opacity);
    if (!(mean.z > near && radius > 0.0f)) continue;
    const glm::vec3 scale = drawnScale(glm::exp(model.log_scale[i]));
    const int c = shortestAxis(model.log_scale[i]);
    const glm::ivec3 order(axisU(c), axisV(c), c);
    const glm::mat3 axes = rotation * rotationFromQuaternion(model.rotation[i]);
    const glm::mat3 ordered(axes[order.x], axes[order.y], axes[order.z]);
    const glm::vec3 ordered_scale(scale[order.x], scale[order.y], scale[order.z]);
    Projected p;
    glm::vec4 box(0.0f, 0.0f, camera.size.x, camera.size.y);
    glm::vec4 bounded;
    if (splatBox(mean, ordered, ordered_scale, radius, model.intersection == IntersectionModel::plane, focal_center,
                 bounded)) {
      box = glm::vec4(glm::max(glm::vec2(box), glm::vec2(bounded)),
                      glm::min(glm::vec2(box.z, box.w), glm::vec2(bounded.z, bounded.w)));
    }
    if (!(box.x < box.z && box.y < box.w)) continue;
    p.box = glm::ivec4(glm::floor(box.x), glm::floor(box.y), glm::ceil(box.z), glm::ceil(box.w));
    p.gaussian = static_cast<std::uint32_t>(i);
    p.splat = makeSplat(mean, ordered, ordered_scale, focal_center, opacity, glm::vec3(0.0f));
    projected.push_back(p);
  }
  std::sort(projected.begin(), projected.end(), [](const Projected& a, const Projected& b) {
    const float depth_a = a.splat.center_depth_opacity.z, depth_b = b.splat.center_depth_opacity.z;
    return depth_a != depth_b ? depth_a < depth_b : a.gaussian < b.gaussian;
  });
  return projected;
}

float textureAlpha(const GaussianModel& model, std::size_t gaussian, glm::vec2 uv) {
  const TextureRect& rect = model.atlas.rects[gaussian];
  if (rect.texelCount() == 0) return 1.0f;
  if (!samplesTexture(static_cast<unsigned>(model.outside), uv)) {
    return model.outside == TextureOutside::clip ? 0.0f : 1.0f;
  }
  if (!hasAlpha(model.texture_mode)) return 1.0f;
  const TextureTap u = textureTap(uv.x, rect.width), v = textureTap(uv.y, rect.height);
  const glm::vec4* row0 = model.atlas.texels.data() + rect.offset + std::size_t{v.i0} * rect.width;
  const glm::vec4* row1 = model.atlas.texels.data() + rect.offset + std::size_t{v.i1} * rect.width;
  return glm::mix(glm::mix(row0[u.i0].a, row0[u.i1].a, u.fraction), glm::mix(row1[u.i0].a, row1[u.i1].a, u.fraction),
                  v.fraction);
}

void addView(const GaussianModel& model, const Camera& camera, float near, std::vector<double>& weights) {
  const bool has_textures = model.texture_mode != TextureMode::none && !model.atlas.rects.empty();
  const auto intersection = static_cast<unsigned>(model.intersection);
  std::vector<float> transmittance(static_cast<std::size_t>(camera.size.x) * camera.size.y, 1.0f);
  for (const Projected& p : project(model, camera, near)) {
    const Splat& s = p.splat;
    double sum = 0.0;
    for (int y = p.box.y; y < p.box.w; ++y) {
      for (int x = p.box.x; x < p.box.z; ++x) {
        float& left = transmittance[static_cast<std::size_t>(y) * camera.size.x + x];
        if (left == 0.0f) continue;  // the pixel has ended
        const glm::vec2 delta = glm::vec2(x, y) + 0.5f - glm::vec2(s.center_depth_opacity);
        Hit hit;
        if (!intersectSplat(glm::vec3(s.wx_r), glm::vec3(s.wy_g), glm::vec3(s.dx_b), glm::vec3(s.dy_offset),
                            glm::vec3(s.d0_size), s.center_depth_opacity.z, intersection, delta, near, hit)) {
          continue;
        }
        float alpha = s.center_depth_opacity.w * std::exp(-0.5f * hit.power);
        if (has_textures) alpha *= textureAlpha(model, p.gaussian, hit.uv);
        alpha = std::min(alpha, kAlphaMax);
        if (!(alpha >= kAlphaMin)) continue;  // also what is no number: weights are sorted
        const float rest = left * (1.0f - alpha);
        if (rest >= kTransmittanceStop) sum += left * alpha;
        left = rest >= kTransmittanceStop ? rest : 0.0f;  // docs/math.md (5b)
      }
    }
    weights[p.gaussian] += sum;
  }
}

}  // namespace

std::vector<double> blendWeights(const GaussianModel& model, std::span<const Camera> views, float near) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  std::vector<double> weights(model.size(), 0.0);
  for (std::size_t first = 0; first < views.size(); first += kViewsAtATime) {
    const std::span<const Camera> some = views.subspan(first, std::min(kViewsAtATime, views.size() - first));
    std::vector<std::vector<double>> by_view(some.size(), std::vector<double>(model.size(), 0.0));
    parallelFor(static_cast<std::int64_t>(some.size()), 1, [&](std::int64_t v) {
      addView(model, some[static_cast<std::size_t>(v)], near, by_view[static_cast<std::size_t>(v)]);
    });
    for (const std::vector<double>& view : by_view) {
      for (std::size_t i = 0; i < weights.size(); ++i) weights[i] += view[i];
    }
  }
  return weights;
}

}  // namespace tg
