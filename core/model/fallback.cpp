// SPDX-License-Identifier: Apache-2.0
// The best untextured stand-in for a textured model.
#include "core/model/fallback.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

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
  double variance = 0.0;  // [sigma^2] of the positions by their weights
};

Samples makeSamples() {
  Samples samples;
  for (int i = 0; i < kSamples; ++i) {
    const double u = kTextureExtent * ((2.0 * i + 1.0) / kSamples - 1.0);
    samples.position[i] = static_cast<float>(u);
    samples.weight[i] = std::exp(-0.5 * u * u);
    samples.variance += samples.weight[i] * u * u;
  }
  samples.variance /= std::accumulate(samples.weight.begin(), samples.weight.end(), 0.0);
  return samples;
}

struct TextureMean {
  glm::dvec3 color{0.0};  // sum w a c / sum w a
  double alpha = 1.0;     // sum w a / sum w
  double area = 1.0;      // of what alpha leaves of the Gaussian, by its variances, over the Gaussian's
};

// A Gaussian of part of the area stands in for what alpha leaves: of the area that alpha's variances have, or of
// alpha's mean, with the whole opacity, if that is more. Scales in steps, so that small changes of texels leave them
// alone.
struct StandIn {
  double opacity = 1.0;    // factor
  float log_scale = 0.0f;  // change of the logarithm
};
StandIn standIn(const TextureMean& mean, FallbackScale scale) {
  if (scale == FallbackScale::kept || !(mean.alpha > 0.0)) return {mean.alpha, 0.0f};
  constexpr double kLeastArea = 1.0 / 64, kSteps = 16;  // in a factor of e of the scale
  const double area = std::clamp(std::max(mean.area, mean.alpha), kLeastArea, 1.0);
  const double log_scale = -std::round(-0.5 * kSteps * std::log(area)) / kSteps;
  return {std::min(mean.alpha / std::exp(2.0 * log_scale), 1.0), static_cast<float>(log_scale)};
}

TextureMean meanOf(const glm::vec4* texels, const TextureRect& rect, bool use_color, bool use_alpha,
                   const Samples& samples) {
  std::array<TextureTap, kSamples> taps_u;
  for (int i = 0; i < kSamples; ++i) taps_u[i] = textureTap(samples.position[i], rect.width);
  glm::dvec3 color(0.0);
  double alpha = 0.0;
  double weight = 0.0;
  glm::dvec2 place(0.0), square(0.0);
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
      const glm::dvec2 at(samples.position[i], samples.position[j]);
      place += w * a * at;
      square += w * a * at * at;
      weight += w;
    }
  }
  TextureMean mean;
  if (use_color && alpha > 0.0) mean.color = color / alpha;
  mean.alpha = alpha / weight;
  if (alpha > 0.0) {
    const glm::dvec2 variance = glm::max(square / alpha - place / alpha * (place / alpha), glm::dvec2(0.0));
    mean.area = std::sqrt(variance.x * variance.y) / samples.variance;
  }
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

GaussianModel bakeFallback(const GaussianModel& model, FallbackScale scale) {
  GaussianModel base = withoutTextures(model);
  forEachMean(model, [&](std::int64_t i, const TextureMean& mean) {
    glm::vec3& color = base.sh[i * model.shCount()];
    constexpr float kMost = std::numeric_limits<float>::max();
    color = glm::clamp(color + glm::vec3(mean.color / static_cast<double>(kShC0)), -kMost, kMost);
    if (!hasAlpha(model.texture_mode)) return;
    const StandIn alpha = standIn(mean, scale);
    base.opacity_logit[i] = logitFromOpacity(sigmoid(model.opacity_logit[i], alpha.opacity));
    base.log_scale[i] += alpha.log_scale;
  });
  return base;
}

std::vector<glm::vec3> meanTextureColors(const GaussianModel& model) {
  std::vector<glm::vec3> colors(model.size(), glm::vec3(0.0f));
  forEachMean(model, [&](std::int64_t i, const TextureMean& mean) {
    colors[i] = glm::vec3(mean.color / static_cast<double>(kShC0));
  });
  return colors;
}

void removeFallback(GaussianModel& model, FallbackScale scale) {
  forEachMean(model, [&](std::int64_t i, const TextureMean& mean) {
    model.sh[i * model.shCount()] -= glm::vec3(mean.color / static_cast<double>(kShC0));
    if (!hasAlpha(model.texture_mode) || !(mean.alpha > 0.0)) return;
    const StandIn alpha = standIn(mean, scale);
    model.opacity_logit[i] = logitFromOpacity(std::min(opacityOf(model, i) / alpha.opacity, 1.0));
    model.log_scale[i] -= alpha.log_scale;
  });
}

}  // namespace tg
