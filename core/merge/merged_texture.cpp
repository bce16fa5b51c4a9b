// SPDX-License-Identifier: Apache-2.0
// The texture of a Gaussian that stands for two.
#include "core/merge/merged_texture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "shared/limits.h"
#include "shared/splat.h"

namespace tg {
namespace {

constexpr int kSamplesPerTexel = 3, kLeastSamples = 13;  // along an axis
constexpr double kOpacityReach = 2.0;                    // [sigma] within which the merged opacity reaches both
constexpr double kMostMerged = 0.999, kLeastMerged = 1e-6;
constexpr double kLeastLight = 1e-9;  // of opacity: below it no colour is told
constexpr int kLongestSide = 256;     // [texels] of a merged texture
constexpr double kLeastMost = 1024;   // [texels] that a merged texture may have in any case

// The axes of a texture (docs/math.md 2.2): u, v, and the normal last. As float logarithms have it, which are stored:
// two sigmas that differ in double may be one there.
std::array<int, 3> axisOrder(glm::dvec3 sigma) {
  const int normal = shortestAxis(glm::vec3(glm::log(sigma)));
  return {axisU(normal), axisV(normal), normal};
}

struct Look {
  double alpha = 0.0;
  glm::dvec3 color{0.0};
};

// A Gaussian as rays along one direction meet it.
class Source {
 public:
  Source(const GaussianModel& model, std::size_t i, glm::dvec3 direction)
      : model_(model), rect_(rectOf(model, i)), mean_(model.mean[i]), opacity_(opacityOf(model, i)) {
    const glm::dvec3 sigma = glm::max(sigmaOf(model, i), glm::dvec3(1e-30));
    const glm::dmat3 axes = axesOf(model, i);
    for (int k = 0; k < 3; ++k) rows_[k] = axes[k] / sigma[k];
    order_ = axisOrder(sigma);
    base_ = glm::dvec3(0.5) + double{kShC0} * glm::dvec3(model.sh[i * model.shCount()]);
    direction_ = inFrame(direction);
  }

  Look at(glm::dvec3 point) const {
    glm::dvec3 p = inFrame(point - mean_);
    const double length = glm::dot(direction_, direction_);
    if (length > 0.0) p -= glm::dot(p, direction_) / length * direction_;  // docs/math.md (2.1b)
    const glm::dvec4 texel = sample(p[order_[0]], p[order_[1]]);
    return {opacity_ * std::exp(-0.5 * glm::dot(p, p)) * texel.a, base_ + glm::dvec3(texel)};
  }

 private:
  glm::dvec3 inFrame(glm::dvec3 v) const {
    return {glm::dot(rows_[0], v), glm::dot(rows_[1], v), glm::dot(rows_[2], v)};
  }

  // docs/math.md 3.
  glm::dvec4 sample(double u, double v) const {
    const glm::dvec4 neutral(0.0, 0.0, 0.0, 1.0);
    if (rect_.texelCount() == 0 || !std::isfinite(u) || !std::isfinite(v)) return neutral;
    const bool inside = std::abs(u) <= kTextureExtent && std::abs(v) <= kTextureExtent;
    if (!inside && model_.outside == TextureOutside::base) return neutral;
    if (!inside && model_.outside == TextureOutside::clip) return glm::dvec4(0.0);
    const auto tap = [](double at, int size, int& first, int& second) {
      const double limited = std::clamp<double>(at, -kTextureExtent, kTextureExtent);
      const double x = (limited + kTextureExtent) * (size - 1) / (2.0 * kTextureExtent);
      first = std::clamp(static_cast<int>(std::floor(x)), 0, std::max(size - 2, 0));
      second = std::min(first + 1, size - 1);
      return x - first;
    };
    int i0, i1, j0, j1;
    const double fu = tap(u, rect_.width, i0, i1), fv = tap(v, rect_.height, j0, j1);
    const auto texel = [&](int i, int j) {
      return glm::dvec4(model_.atlas.texels[rect_.offset + static_cast<std::size_t>(j) * rect_.width + i]);
    };
    return glm::mix(glm::mix(texel(i0, j0), texel(i1, j0), fu), glm::mix(texel(i0, j1), texel(i1, j1), fu), fv);
  }

  const GaussianModel& model_;
  const TextureRect rect_;
  const glm::dvec3 mean_;
  const double opacity_;
  std::array<glm::dvec3, 3> rows_;
  std::array<int, 3> order_;
  glm::dvec3 base_, direction_;
};

int samplesOf(int size) { return std::max(kLeastSamples, kSamplesPerTexel * (size - 1) + 1); }

}  // namespace

glm::ivec2 mergedSize(const TextureRect& a, const TextureRect& b) {
  glm::ivec2 size = glm::min(glm::ivec2(std::max(a.width, b.width), std::max(a.height, b.height)), kLongestSide);
  const double most = std::max(kLeastMost, static_cast<double>(a.texelCount()) + b.texelCount());
  const double texels = static_cast<double>(size.x) * size.y;
  if (texels <= most) return size;
  int& shorter = size.x < size.y ? size.x : size.y;
  int& longer = size.x < size.y ? size.y : size.x;
  shorter = std::max(1, static_cast<int>(shorter * std::sqrt(most / texels)));
  longer = std::min(longer, static_cast<int>(most / shorter));
  return size;
}

MergedTexture mergedTexture(const GaussianModel& model, std::size_t a, std::size_t b, const MergedShape& shape,
                            AxisFits& fits) {
  const TextureRect x = rectOf(model, a), y = rectOf(model, b);
  TG_ASSERT(x.texelCount() + y.texelCount() > 0, "one of both has a texture");
  MergedTexture merged{mergedSize(x, y), {}, shape.opacity};
  const auto [u, v, normal] = axisOrder(shape.sigma);
  const Source first(model, a, shape.axes[normal]), second(model, b, shape.axes[normal]);
  const glm::ivec2 grid(samplesOf(merged.size.x), samplesOf(merged.size.y));
  const glm::dvec3 base = glm::dvec3(0.5) + double{kShC0} * shape.dc;
  const auto place = [](int k, int count) { return kTextureExtent * (2.0 * k / (count - 1) - 1.0); };

  std::vector<glm::vec4> fine(static_cast<std::size_t>(grid.x) * grid.y);
  std::vector<double> ratio(fine.size());  // of the alpha to the merged Gaussian's value
  double most = kLeastMerged;
  for (int j = 0; j < grid.y; ++j) {
    for (int i = 0; i < grid.x; ++i) {
      const double pu = place(i, grid.x), pv = place(j, grid.y);
      const glm::dvec3 point = shape.mean + pu * shape.sigma[u] * shape.axes[u] + pv * shape.sigma[v] * shape.axes[v];
      Look one = first.at(point), two = second.at(point);
      one.alpha *= shape.part_a;
      two.alpha *= shape.part_b;
      const double light = one.alpha + two.alpha, square = pu * pu + pv * pv;
      const std::size_t at = static_cast<std::size_t>(j) * grid.x + i;
      ratio[at] = (light - one.alpha * two.alpha) / std::exp(-0.5 * square);
      if (square <= kOpacityReach * kOpacityReach) most = std::max(most, ratio[at]);
      if (light < kLeastLight) continue;
      fine[at] = glm::vec4(glm::vec3((one.alpha * one.color + two.alpha * two.color) / light - base), 0.0f);
    }
  }
  if (hasAlpha(model.texture_mode)) merged.opacity = std::min(most, kMostMerged);
  for (std::size_t k = 0; k < fine.size(); ++k) {
    fine[k].a = static_cast<float>(std::clamp(ratio[k] / merged.opacity, 0.0, 1.0));
  }
  merged.texels = fitTexture(fine, fits.get(grid.x, merged.size.x), fits.get(grid.y, merged.size.y));
  neutralize(merged.texels, model.texture_mode);
  return merged;
}

}  // namespace tg
