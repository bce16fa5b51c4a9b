// SPDX-License-Identifier: Apache-2.0
// The best untextured stand-in for a textured model.
#include "core/model/fallback.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "shared/texture.h"

namespace tg {
namespace {

// Samples per axis. The midpoint rule on a Gaussian converges faster than any power; 12 over +-3 sigma leave 1e-4.
constexpr int kSamples = 12;

struct Samples {
  std::array<float, kSamples> position;  // [sigma]
  std::array<double, kSamples> weight;
};

Samples makeSamples() {
  Samples samples;
  for (int i = 0; i < kSamples; ++i) {
    const double u = kTextureExtent * ((2.0 * i + 1.0) / kSamples - 1.0);
    samples.position[i] = static_cast<float>(u);
    samples.weight[i] = std::exp(-0.5 * u * u);
  }
  return samples;
}

struct TextureMean {
  glm::dvec3 color{0.0};  // sum w a c / sum w a
  double alpha = 1.0;     // sum w a / sum w
};

TextureMean meanOf(const glm::vec4* texels, const TextureRect& rect, bool use_color, bool use_alpha,
                   const Samples& samples) {
  std::array<TextureTap, kSamples> taps_u;
  for (int i = 0; i < kSamples; ++i) taps_u[i] = textureTap(samples.position[i], rect.width);
  glm::dvec3 color(0.0);
  double alpha = 0.0;
  double weight = 0.0;
  for (int j = 0; j < kSamples; ++j) {
    const TextureTap v = textureTap(samples.position[j], rect.height);
    const glm::vec4* row0 = texels + static_cast<std::size_t>(v.i0) * rect.width;
    const glm::vec4* row1 = texels + static_cast<std::size_t>(v.i1) * rect.width;
    for (int i = 0; i < kSamples; ++i) {
      const TextureTap& u = taps_u[i];
      const glm::vec4 texel = glm::mix(glm::mix(row0[u.i0], row0[u.i1], u.fraction),
                                       glm::mix(row1[u.i0], row1[u.i1], u.fraction), v.fraction);
      const double w = samples.weight[i] * samples.weight[j];
      const double a = use_alpha ? texel.a : 1.0;
      color += w * a * glm::dvec3(texel);
      alpha += w * a;
      weight += w;
    }
  }
  TextureMean mean;
  if (use_color && alpha > 0.0) mean.color = color / alpha;
  mean.alpha = alpha / weight;
  return mean;
}

// Calls body(i, mean) for the Gaussians with textures, on all threads.
template <typename Body>
void forEachMean(const GaussianModel& model, const Body& body) {
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  if (!isTextured(model)) return;
  const Samples samples = makeSamples();
  parallelFor(static_cast<std::int64_t>(model.size()), 256, [&](std::int64_t i) {
    const TextureRect& rect = model.atlas.rects[i];
    if (rect.texelCount() == 0) return;
    const TextureMode mode = model.texture_mode;
    body(i, meanOf(model.atlas.texels.data() + rect.offset, rect, hasColor(mode), hasAlpha(mode), samples));
  });
}

}  // namespace

GaussianModel bakeFallback(const GaussianModel& model) {
  GaussianModel base = withoutTextures(model);
  forEachMean(model, [&](std::int64_t i, const TextureMean& mean) {
    base.sh[i * model.shCount()] += glm::vec3(mean.color / static_cast<double>(kShC0));
    if (hasAlpha(model.texture_mode)) {
      base.opacity_logit[i] = logitFromOpacity(sigmoid(model.opacity_logit[i], mean.alpha));
    }
  });
  return base;
}

void removeFallback(GaussianModel& model) {
  forEachMean(model, [&](std::int64_t i, const TextureMean& mean) {
    model.sh[i * model.shCount()] -= glm::vec3(mean.color / static_cast<double>(kShC0));
    if (hasAlpha(model.texture_mode) && mean.alpha > 0.0) {
      model.opacity_logit[i] = logitFromOpacity(std::min(opacityOf(model, i) / mean.alpha, 1.0));
    }
  });
}

}  // namespace tg
