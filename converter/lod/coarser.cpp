// SPDX-License-Identifier: Apache-2.0
// Rounds of pairs: neighbours along two space-filling curves, those first whose merging shows least.
#include "converter/lod/coarser.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "core/merge/curves.h"
#include "core/merge/merge_pair.h"
#include "core/model/fallback.h"
#include "core/model/texture_fit.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "shared/splat.h"

namespace tg {
namespace {

constexpr std::size_t kNeighbours = 4;  // looked at along each curve
constexpr double kRoundPart = 0.3;      // of the Gaussians merged before neighbours are looked for again
constexpr double kMostExcess = 1.5;     // of mass over the area, that makes a Gaussian wider
constexpr double kLeastCost = 1e-6;     // of pairs alike: the lighter goes first
constexpr double kColorPart = 0.3;      // of a pair's cost, for a squared difference of 1 in colour

GaussianModel withHalfTextures(const GaussianModel& model) {
  if (!isTextured(model)) return withoutTextures(model);
  GaussianModel half = model;
  neutralize(half.atlas.texels, half.texture_mode);  // moments and means take all channels
  const GaussianModel means = bakeFallback(model, FallbackScale::kept);
  std::vector<glm::ivec2> sizes(model.size(), glm::ivec2(0));
  bool textured = false;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const TextureRect& rect = model.atlas.rects[i];
    if (std::max(rect.width, rect.height) >= 4) {
      sizes[i] = {std::max(rect.width / 2, 1), std::max(rect.height / 2, 1)};
      textured = true;
    } else {
      half.opacity_logit[i] = means.opacity_logit[i];
      half.sh[i * model.shCount()] = means.sh[i * model.shCount()];
    }
  }
  if (!textured) return withoutTextures(half);
  half.atlas = resizedAtlas(half.atlas, sizes);
  return half;
}

struct Pair {
  float cost;
  std::uint32_t a, b;  // a < b
  bool operator<(const Pair& other) const {
    if (cost != other.cost) return cost < other.cost;
    return a != other.a ? a < other.a : b < other.b;
  }
};

// Of the two longer axes, nearly, without the axes: the root of the sum of the principal minors.
double nearArea(const glm::dmat3& c) {
  const double minors = c[0][0] * c[1][1] - c[0][1] * c[0][1] + c[0][0] * c[2][2] - c[0][2] * c[0][2] +
                        c[1][1] * c[2][2] - c[1][2] * c[1][2];
  return std::sqrt(std::max(minors, kLeastVariance * kLeastVariance));
}

class Merger {
 public:
  explicit Merger(GaussianModel& model) : model_(model), alive_(model.size()) {
    std::iota(alive_.begin(), alive_.end(), 0u);
    const std::vector<glm::vec4> means = textureMeans(model.atlas, model.size());
    for (std::size_t i = 0; i < model.size(); ++i) {
      moments_.push_back(momentsOf(model, i, static_cast<double>(means[i].a)));
      areas_.push_back(nearArea(moments_[i].covariance));
      colors_.push_back(kShC0 * model.sh[i * model.shCount()] + glm::vec3(means[i]));
    }
  }

  // What cannot be as opaque as its mass asks for is wider instead, in its plane: an opaque surface stays closed.
  void widen(std::uint32_t i) {
    if (rectOf(model_, i).texelCount() != 0) return;  // whose texture has the opacity of both
    glm::vec3& log_scale = model_.log_scale[i];
    const double excess = moments_[i].mass / areaOf(sigmaOf(model_, i));
    if (excess <= 1.0) return;
    const int shortest = shortestAxis(log_scale);
    for (int k = 0; k < 3; ++k) {
      if (k != shortest) log_scale[k] += static_cast<float>(0.5 * std::log(std::min(excess, kMostExcess)));
    }
  }

  // Those that are left.
  std::vector<std::uint32_t> merge(std::size_t count) {
    std::vector<std::uint8_t> used(model_.size());
    while (alive_.size() > count) {
      const auto part = static_cast<std::size_t>(kRoundPart * static_cast<double>(alive_.size()));
      const std::size_t most = std::min(alive_.size() - count, std::max<std::size_t>(part, 1));
      std::vector<Pair> pairs = candidates();
      std::sort(pairs.begin(), pairs.end());
      std::ranges::fill(used, std::uint8_t{0});
      std::size_t done = 0;
      for (const Pair& pair : pairs) {
        if (done == most) break;
        if (used[pair.a] != 0 || used[pair.b] != 0) continue;
        used[pair.a] = 1;
        used[pair.b] = 2;
        mergeInto(pair.a, pair.b);
        ++done;
      }
      std::erase_if(alive_, [&](std::uint32_t i) { return used[i] == 2; });
    }
    return alive_;
  }

 private:
  std::vector<Pair> candidates() const {
    std::vector<glm::dvec3> places;
    for (const std::uint32_t i : alive_) places.push_back(moments_[i].mean);
    std::vector<Pair> pairs;
    for (const std::vector<std::uint32_t>& order : curveOrders(places)) {
      for (std::size_t k = 0; k < order.size(); ++k) {
        for (std::size_t j = k + 1; j < std::min(order.size(), k + 1 + kNeighbours); ++j) {
          const auto [a, b] = std::minmax(alive_[order[k]], alive_[order[j]]);
          pairs.push_back({cost(a, b), a, b});
        }
      }
    }
    return pairs;
  }

  // How much larger the whole is than its parts and how their colours differ, as far as there is something of both.
  float cost(std::size_t a, std::size_t b) const {
    const GaussianMoments &x = moments_[a], &y = moments_[b];
    const GaussianMoments whole = merged(x, y);
    const double parts = (x.mass * areas_[a] + y.mass * areas_[b]) / whole.mass;
    const double growth = std::log(std::max(nearArea(whole.covariance) / parts, 1.0));
    const glm::dvec3 color = glm::dvec3(colors_[a]) - glm::dvec3(colors_[b]);  // which floats may not hold
    const double cost = x.mass * y.mass / whole.mass * (growth + kColorPart * glm::dot(color, color) + kLeastCost);
    // Pairs are sorted by it: a number always.
    return std::isfinite(cost) ? static_cast<float>(std::min(cost, double{FLT_MAX})) : FLT_MAX;
  }

  void mergeInto(std::uint32_t a, std::uint32_t b) {
    const auto part = static_cast<float>(moments_[a].mass / (moments_[a].mass + moments_[b].mass));
    colors_[a] = glm::mix(colors_[b], colors_[a], part);
    moments_[a] = mergePair(model_, {a, moments_[a]}, {b, moments_[b]}, fits_);
    areas_[a] = nearArea(moments_[a].covariance);
  }

  GaussianModel& model_;
  std::vector<std::uint32_t> alive_;      // in their order
  std::vector<GaussianMoments> moments_;  // [N]
  std::vector<double> areas_;             // [N]
  std::vector<glm::vec3> colors_;         // [N] with those of textures
  AxisFits fits_;
};

}  // namespace

GaussianModel coarser(const GaussianModel& model, std::size_t count) {
  TG_ASSERT(lengthsAgree(model) && count >= 1, "a model, and a Gaussian at least");
  GaussianModel half = withHalfTextures(model);
  if (model.size() <= count) return half;
  Merger merger(half);
  const std::vector<std::uint32_t> kept = merger.merge(count);
  for (const std::uint32_t i : kept) merger.widen(i);
  return select(half, kept);
}

}  // namespace tg
