// SPDX-License-Identifier: Apache-2.0
// Gaussians that are wide for their distance, in pieces: what an affine projection gets wrong.
#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/model/model.h"
#include "shared/splat.h"

namespace tg {

// From a place to the nearest of [count] eyes, the largest number's root where there are none. In one text for the CPU
// and CUDA.
TG_FN double nearestDistance(glm::dvec3 place, const glm::dvec3* eyes, std::size_t count) {
  double nearest = std::numeric_limits<double>::max();
  for (std::size_t k = 0; k < count; ++k) {
    const glm::dvec3 apart = eyes[k] - place;
    nearest = min(nearest, glm::dot(apart, apart));
  }
  return sqrt(nearest);
}

struct WidePieces {
  std::vector<std::uint32_t> wide;    // Gaussians that are too wide, ascending
  std::vector<std::uint32_t> source;  // of every piece the Gaussian that it is of, ascending
  GaussianModel pieces;               // that stand for them, without textures
};

struct WideLimits {
  double bound = 0;  // a sigma may be so large a part of the distance to the nearest eye
  int rounds = 4;    // into three each
  std::size_t most_pieces = std::numeric_limits<std::size_t>::max();  // later Gaussians stay whole where more would be
};

// Each wide Gaussian becomes three along its widest axis, those again, until they are narrow enough or there were so
// many rounds. The pieces' opacities are such that, blended, they let through what the whole does. Nothing without
// eyes.
WidePieces splitWide(const GaussianModel& model, std::span<const glm::dvec3> eyes, const WideLimits& limits);

}  // namespace tg
