// SPDX-License-Identifier: Apache-2.0
// How many axes of a Gaussian matter: 1 a needle, 2 a disc, 3 a ball.
#pragma once
#include <array>
#include <cstddef>
#include <glm/glm.hpp>
#include <span>

namespace tg {

// exp of the entropy of the squared sigmas over their sum (Roy & Vetterli 2007; for Gaussians Hyung et al. 2024).
double effectiveRank(const glm::vec3& log_scale);

struct EffectiveRanks {
  static constexpr int kBins = 40;  // of width 0.05 over [1, 3], the last one closed
  std::array<std::size_t, kBins> bins{};
  std::size_t count = 0;
  double mean = 0;
  double needle = 0, flat = 0, round = 0;  // shares nearest to 1, 2 and 3: below 1.5, up to 2.5, above
};
EffectiveRanks effectiveRanks(std::span<const glm::vec3> log_scales);

}  // namespace tg
