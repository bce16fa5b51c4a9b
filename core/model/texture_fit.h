// SPDX-License-Identifier: Apache-2.0
// A texture at another size: the one that is closest to it where the Gaussian lets it be seen.
#pragma once
#include <glm/glm.hpp>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/model/atlas.h"

namespace tg {

// One axis: the matrix from texels of one size to those of another, whose bilinear functions on [-3, 3] sigma differ
// least in the mean square with weight exp(-u^2), the square of the Gaussian's. Exact where the larger grid holds the
// smaller one's nodes. The identity for equal sizes.
class AxisFit {
 public:
  AxisFit(int from, int to);  // sizes >= 1
  int from() const { return from_; }
  int to() const { return to_; }
  double at(int row, int column) const { return matrix_[static_cast<std::size_t>(row * from_ + column)]; }

 private:
  int from_, to_;
  std::vector<double> matrix_;  // to x from, row-major
};

// Fits by pair of sizes, made once each. Not for several threads at a time, but what it returned stays valid.
class AxisFits {
 public:
  const AxisFit& get(int from, int to);

 private:
  std::map<std::pair<int, int>, std::unique_ptr<AxisFit>> fits_;
};

// [to.y * to.x] from [from.y * from.x]; alpha is clamped to [0, 1].
std::vector<glm::vec4> fitTexture(std::span<const glm::vec4> texels, const AxisFit& u, const AxisFit& v);

// Every texture at its new size, consecutive in Gaussian order; 0 x 0 drops one, an equal size copies it bit by bit.
// Throws Error(badData) for more than kMaxModelTexels in all. sizes: [N] width, height.
TextureAtlas resizedAtlas(const TextureAtlas& atlas, std::span<const glm::ivec2> sizes);

}  // namespace tg
