// SPDX-License-Identifier: Apache-2.0
// The least seen ones go, or pairs are merged by matching their moments.
#include "core/merge/decimate.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "core/merge/curves.h"
#include "core/merge/merge_pair.h"
#include "core/merge/moments.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "shared/limits.h"

namespace tg {
namespace {

constexpr std::size_t kNeighbours = 12;  // looked at along each of two space-filling curves
constexpr double kColorPart = 4.0;       // of a pair's cost, for a squared difference of 1 in colour
constexpr double kRoundPart = 0.2;       // of the Gaussians merged before neighbours are looked for again
constexpr double kTexturePart = 3.0;     // of a squared difference of 1 in colour, for a texture's squared contrast
constexpr double kRemovedPart = 2.0;     // of what views show of a Gaussian, where it is not merged but removed
constexpr double kUnseenRemoved = 1e-15;
constexpr double kUnseenPart = 1e-12;  // orders pairs that no view shows

double opaqueArea(const GaussianModel& model, std::size_t i) {
  return opacityOf(model, i) * areaOf(boundedSigma(model, i));
}

struct Pair {
  double cost;
  std::uint32_t a, b;  // a < b; a = b: it is removed
  bool operator<(const Pair& other) const {
    if (cost != other.cost) return cost < other.cost;
    return a != other.a ? a < other.a : b < other.b;
  }
};

class PairMerger {
 public:
  PairMerger(GaussianModel& model, std::vector<double> weights) : model_(model), weights_(std::move(weights)) {}

  // Merges up to `most` pairs of Gaussians that are in none yet; how many.
  std::size_t round(std::size_t most) {
    const std::size_t n = model_.size();
    moments_.resize(n);
    means_.assign(n, glm::vec4(0.0f, 0.0f, 0.0f, 1.0f));
    contrast_.assign(n, 0.0);
    if (isTextured(model_)) {
      means_ = textureMeans(model_.atlas, n);
      contrast_ = contrasts();
    }
    for (std::size_t i = 0; i < n; ++i) moments_[i] = momentsOf(model_, i, means_[i].a);
    std::vector<Pair> pairs = candidates();
    std::sort(pairs.begin(), pairs.end());
    std::vector<std::uint8_t> gone(n, 0), used(n, 0);
    std::size_t done = 0;
    for (const Pair& pair : pairs) {
      if (done == most) break;
      if (used[pair.a] || used[pair.b]) continue;
      used[pair.a] = used[pair.b] = 1;
      gone[pair.b] = 1;
      if (pair.a != pair.b) merge(pair);
      ++done;
    }
    if (done == 0) return 0;
    std::vector<std::uint32_t> kept;
    for (std::uint32_t i = 0; i < n; ++i) {
      if (gone[i] == 0) kept.push_back(i);
    }
    for (std::size_t i = 0; i < kept.size(); ++i) weights_[i] = weights_[kept[i]];
    weights_.resize(kept.size());
    model_ = select(model_, kept);
    return done;
  }

  const std::vector<double>& weights() const { return weights_; }

 private:
  std::vector<double> contrasts() {
    std::vector<double> found(model_.size(), 0.0);
    std::map<int, std::vector<double>> shares;
    for (const TextureRect& rect : model_.atlas.rects) {
      for (const int size : {int{rect.width}, int{rect.height}}) {
        if (size > 0 && !shares.contains(size)) shares[size] = texelShares(size);
      }
    }
    for (std::size_t i = 0; i < found.size(); ++i) {
      const TextureRect& rect = model_.atlas.rects[i];
      for (std::uint32_t t = 0; t < rect.texelCount(); ++t) {
        const glm::dvec4 from = glm::dvec4(model_.atlas.texels[rect.offset + t] - means_[i]);
        found[i] += shares[rect.width][t % rect.width] * shares[rect.height][t / rect.width] * glm::dot(from, from);
      }
    }
    return found;
  }

  // Pairs of neighbours.
  std::vector<Pair> candidates() const {
    std::vector<glm::dvec3> places;
    for (const GaussianMoments& m : moments_) places.push_back(m.mean);
    std::vector<Pair> pairs;
    for (const std::vector<std::uint32_t>& order : curveOrders(places)) {
      const std::size_t first = pairs.size();
      pairs.resize(first + order.size() * kNeighbours, Pair{0.0, 0, 0});
      parallelFor(static_cast<std::int64_t>(order.size()), 256, [&](std::int64_t item) {
        const std::size_t k = static_cast<std::size_t>(item);
        for (std::size_t j = k + 1; j < std::min(order.size(), k + 1 + kNeighbours); ++j) {
          const auto [a, b] = std::minmax(order[k], order[j]);
          if ((weights_[a] > 0.0) != (weights_[b] > 0.0)) continue;  // what is seen stays as it is
          pairs[first + k * kNeighbours + j - k - 1] = {cost(a, b), a, b};
        }
      });
    }
    std::erase_if(pairs, [](const Pair& pair) { return pair.a == pair.b; });
    if (std::ranges::all_of(weights_, [](double weight) { return weight == 0.0; })) return pairs;
    double largest = kLeastMass;
    for (std::size_t i = 0; i < moments_.size(); ++i) largest = std::max(largest, opaqueArea(model_, i));
    for (std::size_t i = 0; i < moments_.size(); ++i) {
      const auto alone = static_cast<std::uint32_t>(i);
      // Of what no view shows the least goes first.
      pairs.push_back({kRemovedPart * weights_[i] + kUnseenRemoved * opaqueArea(model_, i) / largest, alone, alone});
    }
    return pairs;
  }

  // How much of each one's mass counts: views that show less of one's mass than of the other's would see more of it
  // than before, and the other distorted. What none shows counts as it is.
  std::pair<double, double> shownParts(std::size_t a, std::size_t b) const {
    const double x = weights_[a] / moments_[a].mass, y = weights_[b] / moments_[b].mass;
    const double most = std::max(x, y);
    if (!(most > 0.0) || !std::isfinite(most)) return {1.0, 1.0};
    return {x / most, y / most};
  }

  std::pair<GaussianMoments, GaussianMoments> shownMoments(std::size_t a, std::size_t b) const {
    const auto [x, y] = shownParts(a, b);
    std::pair<GaussianMoments, GaussianMoments> both{moments_[a], moments_[b]};
    both.first.mass = std::max(both.first.mass * x, kLeastMass);
    both.second.mass = std::max(both.second.mass * y, kLeastMass);
    return both;
  }

  // What pictures would show of the change: how much larger the whole is than its parts, and how their colours differ,
  // where the views show both.
  double cost(std::size_t a, std::size_t b) const {
    const auto [x, y] = shownMoments(a, b);
    const GaussianMoments whole = merged(x, y);
    const double area = areaOf(whole);
    const double parts =
        (x.mass * areaOf(boundedSigma(model_, a)) + y.mass * areaOf(boundedSigma(model_, b))) / whole.mass;
    const double growth = std::log(std::max(area / std::max(parts, kLeastVariance), 1.0));
    const std::size_t count = model_.shCount();
    // Of doubles: what floats hold may differ by more than they do.
    const glm::dvec3 color = double{kShC0} * (glm::dvec3(model_.sh[a * count]) - glm::dvec3(model_.sh[b * count])) +
                             glm::dvec3(means_[a]) - glm::dvec3(means_[b]);
    const double sum = weights_[a] + weights_[b];
    const double weight = sum > 0.0 ? weights_[a] * weights_[b] / sum : 0.0;
    const double difference = glm::dot(color, color) + kTexturePart * (contrast_[a] + contrast_[b]);
    const double cost = weight * (growth + kColorPart * difference) + kUnseenPart * growth;
    return std::isfinite(cost) ? cost : std::numeric_limits<double>::max();  // pairs are sorted by it
  }

  // Into the place of pair.a; select() puts texels in order again.
  void merge(const Pair& pair) {
    const auto [x, y] = shownMoments(pair.a, pair.b);
    const auto [part_a, part_b] = shownParts(pair.a, pair.b);
    mergePair(model_, {pair.a, x, part_a}, {pair.b, y, part_b}, fits_);
    weights_[pair.a] += weights_[pair.b];
  }

  GaussianModel& model_;
  std::vector<double> weights_;  // [N] of render/contribution.h
  std::vector<GaussianMoments> moments_;
  std::vector<glm::vec4> means_;  // [N] of textures
  std::vector<double> contrast_;  // [N] of textures: mean square from the mean, colour and alpha
  AxisFits fits_;
};

}  // namespace

void decimate(GaussianModel& model, std::size_t count, std::span<const double> weights) {
  TG_ASSERT(lengthsAgree(model) && weights.size() == model.size(), "the model's arrays have their lengths");
  if (count == 0) throw Error(ErrorKind::usage, "decimation to no Gaussians at all (expected at least 1)");
  if (count >= model.size()) return;
  struct Rank {
    double weight, area;
    std::uint32_t gaussian;
  };
  std::vector<Rank> ranks(model.size());
  for (std::size_t i = 0; i < ranks.size(); ++i) {
    ranks[i] = {weights[i], opaqueArea(model, i), static_cast<std::uint32_t>(i)};
  }
  const auto before = [](const Rank& a, const Rank& b) {
    if (a.weight != b.weight) return a.weight > b.weight;
    if (a.area != b.area) return a.area > b.area;
    return a.gaussian < b.gaussian;
  };
  std::nth_element(ranks.begin(), ranks.begin() + static_cast<std::ptrdiff_t>(count), ranks.end(), before);
  std::vector<std::uint32_t> kept(count);
  for (std::size_t r = 0; r < count; ++r) kept[r] = ranks[r].gaussian;
  std::sort(kept.begin(), kept.end());
  model = select(model, kept);
}

void decimateByMerging(GaussianModel& model, std::size_t count, std::vector<double> weights) {
  TG_ASSERT(lengthsAgree(model) && weights.size() == model.size(), "the model's arrays have their lengths");
  if (count == 0) throw Error(ErrorKind::usage, "decimation to no Gaussians at all (expected at least 1)");
  if (count >= model.size()) return;
  neutralize(model.atlas.texels, model.texture_mode);  // moments and merged textures take all channels
  PairMerger merger(model, std::move(weights));
  while (model.size() > count) {
    const auto part = static_cast<std::size_t>(kRoundPart * static_cast<double>(model.size()));
    if (merger.round(std::min(model.size() - count, std::max<std::size_t>(1, part))) == 0) break;
  }
  decimate(model, count, merger.weights());  // where no pair is left
}

}  // namespace tg
