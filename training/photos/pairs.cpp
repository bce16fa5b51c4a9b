// SPDX-License-Identifier: Apache-2.0
// Pairs of indices.
#include "training/photos/pairs.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <tuple>

namespace tg {
namespace {

constexpr std::size_t kFollowing = 10, kFarthest = 512, kStride = 10;
constexpr std::size_t kNearest = 30, kFollowingSpatial = 5;

Pairs sorted(Pairs pairs) {
  std::ranges::sort(pairs);
  const auto twice = std::ranges::unique(pairs);
  pairs.erase(twice.begin(), twice.end());
  return pairs;
}

}  // namespace

Matching chosenMatching(Matching asked, bool film, const std::vector<std::optional<Place>>& places) {
  if (asked != Matching::automatic) return asked;
  if (film) return Matching::sequential;
  if (places.size() <= kMostExhaustive) return Matching::exhaustive;
  return std::ranges::all_of(places, [](const auto& place) { return place.has_value(); }) ? Matching::spatial
                                                                                          : Matching::sequential;
}

Pairs allPairs(std::size_t count) {
  Pairs pairs;
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = i + 1; j < count; ++j) pairs.emplace_back(i, j);
  }
  return pairs;
}

Pairs sequentialPairs(std::size_t count) {
  Pairs pairs;
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = i + 1; j < count && j <= i + kFollowing; ++j) pairs.emplace_back(i, j);
    for (std::size_t step = 16; step <= kFarthest && i + step < count; step *= 2) pairs.emplace_back(i, i + step);
  }
  for (std::size_t i = 0; i < count; i += kStride) {
    for (std::size_t j = i + kStride; j < count; j += kStride) pairs.emplace_back(i, j);
  }
  return sorted(std::move(pairs));
}

Pairs spatialPairs(const std::vector<Place>& places) {
  Pairs pairs;
  std::vector<std::size_t> others(places.size());
  std::vector<double> distance(places.size());  // squared, of a sphere unrolled around photograph i
  for (std::size_t i = 0; i < places.size(); ++i) {
    const double narrow = std::cos(places[i].latitude * std::numbers::pi / 180);
    for (std::size_t j = 0; j < places.size(); ++j) {
      const double east = std::remainder(places[j].longitude - places[i].longitude, 360.0) * narrow;
      const double north = places[j].latitude - places[i].latitude;
      distance[j] = east * east + north * north;
    }
    std::iota(others.begin(), others.end(), std::size_t{0});
    const std::size_t kept = std::min(kNearest + 1, others.size());
    // Of those at one place, where a phone had one fix for many, the nearest in order.
    const auto rank = [&](std::size_t j) { return std::tuple(distance[j], i < j ? j - i : i - j, j); };
    std::partial_sort(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(kept), others.end(),
                      [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
    for (std::size_t k = 0; k < kept; ++k) {
      if (others[k] != i) pairs.emplace_back(std::min(i, others[k]), std::max(i, others[k]));
    }
    for (std::size_t j = i + 1; j < places.size() && j <= i + kFollowingSpatial; ++j) pairs.emplace_back(i, j);
  }
  return sorted(std::move(pairs));
}

}  // namespace tg
