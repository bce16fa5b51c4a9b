// SPDX-License-Identifier: Apache-2.0
// The first Gaussians: one per point, as wide as its neighbourhood.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/bundle/ply.h"
#include "core/model/model.h"
#include "training/data/dataset.h"

namespace tg {

// Mean squared distance to the three nearest other points (fewer when there are fewer; 0 when there are none). A k-d
// tree: O(N log N).
std::vector<float> meanSquaredNeighborDistance(std::span<const glm::vec3> points);

constexpr float kFirstOpacity = 0.1f;  // 3DGS
// Degree-0 Gaussians at the points: isotropic, sigma = root of the mean squared neighbour distance (at least
// sqrt(1e-7)), opacity kFirstOpacity.
GaussianModel gaussiansFromPoints(const PointCloud& points);

// A random subset of at most `count` points, in their old order.
PointCloud randomSubset(const PointCloud& points, std::size_t count, std::uint64_t seed);

// For data sets without points: uniform in a cube, near-grey. NeRF-synthetic: [-1.3, 1.3]^3. Otherwise the cube reaches
// from where the cameras look to their mean distance from there.
PointCloud randomPoints(const Dataset& dataset, std::size_t count, std::uint64_t seed);

}  // namespace tg
