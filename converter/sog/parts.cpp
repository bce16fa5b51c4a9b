// SPDX-License-Identifier: Apache-2.0
// What the reader and the writer of SOG files agree on.
#include "converter/sog/parts.h"

#include <algorithm>
#include <map>
#include <utility>

namespace tg::sog {
namespace {

// Where the texels of trained models come nearest to their source at the same bytes (docs/lab/converter.md).
constexpr double kShareExponent = 0.7;
constexpr double kOpacityExponent = 0.35;

}  // namespace

std::vector<SizeClass> sizeClasses(std::span<const TextureRect> rects) {
  std::map<std::pair<int, int>, std::vector<std::uint32_t>> by_size;
  for (std::size_t i = 0; i < rects.size(); ++i) {
    if (rects[i].texelCount() == 0) continue;
    by_size[{rects[i].height, rects[i].width}].push_back(static_cast<std::uint32_t>(i));
  }
  std::vector<SizeClass> classes;
  for (auto& [size, gaussians] : by_size) classes.push_back({size.second, size.first, std::move(gaussians)});
  return classes;
}

std::vector<double> texelSpreads(int width, int height) {
  const std::vector<double> u = texelShares(width), v = texelShares(height);
  const double most = *std::max_element(u.begin(), u.end()) * *std::max_element(v.begin(), v.end());
  std::vector<double> spreads;
  for (const double row : v) {
    for (const double column : u)
      spreads.push_back(std::min(std::pow(most / (row * column), kShareExponent), kMostSpread));
  }
  return spreads;
}

double opacitySpread(double opacity) {
  return std::min(std::pow(std::max(opacity, 1e-6), -kOpacityExponent), kMostSpread);
}

}  // namespace tg::sog
