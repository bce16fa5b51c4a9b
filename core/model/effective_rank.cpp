// SPDX-License-Identifier: Apache-2.0
// Ranks and their histogram.
#include "core/model/effective_rank.h"

#include <algorithm>
#include <cmath>

namespace tg {

double effectiveRank(const glm::vec3& log_scale) {
  // Relative to the largest: no sigma, however large or small, overflows.
  const double largest = std::max({log_scale.x, log_scale.y, log_scale.z});
  double total = 0;
  glm::dvec3 squared;
  for (int axis = 0; axis < 3; ++axis) total += squared[axis] = std::exp(2 * (log_scale[axis] - largest));
  double entropy = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double share = squared[axis] / total;
    if (share > 0) entropy -= share * std::log(share);
  }
  return std::exp(entropy);
}

EffectiveRanks effectiveRanks(std::span<const glm::vec3> log_scales) {
  EffectiveRanks ranks;
  ranks.count = log_scales.size();
  std::size_t needle = 0, flat = 0;
  double sum = 0;
  for (const glm::vec3& log_scale : log_scales) {
    const double rank = effectiveRank(log_scale);
    const int bin = static_cast<int>((rank - 1) / 2 * EffectiveRanks::kBins);
    ranks.bins[static_cast<std::size_t>(std::clamp(bin, 0, EffectiveRanks::kBins - 1))]++;
    sum += rank;
    needle += rank < 1.5;
    flat += rank >= 1.5 && rank <= 2.5;
  }
  if (ranks.count > 0) {
    const double count = static_cast<double>(ranks.count);
    ranks.mean = sum / count;
    ranks.needle = static_cast<double>(needle) / count;
    ranks.flat = static_cast<double>(flat) / count;
    ranks.round = static_cast<double>(ranks.count - needle - flat) / count;
  }
  return ranks;
}

}  // namespace tg
