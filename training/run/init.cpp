// SPDX-License-Identifier: Apache-2.0
// k-d tree neighbours, and points to Gaussians.
#include "training/run/init.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "core/system/random.h"
#include "shaders/shared/limits.h"
#include "training/data/normalize.h"

namespace tg {
namespace {

constexpr int kNeighbors = 3;
constexpr float kMinSquaredDistance = 1e-7f;  // 3DGS

// Balanced and implicit: a range of the order array is a node, its middle element splits it.
class NeighborTree {
 public:
  explicit NeighborTree(std::span<const glm::vec3> points)
      : points_(points), order_(points.size()), axis_(points.size()) {
    std::iota(order_.begin(), order_.end(), 0u);
    build(0, order_.size());
  }
  float meanSquaredDistance(std::uint32_t query) const {
    Nearest nearest;
    nearest.distance.fill(std::numeric_limits<float>::infinity());
    search(0, order_.size(), query, nearest);
    float sum = 0;
    int found = 0;
    for (float distance : nearest.distance) {
      if (std::isinf(distance)) break;
      sum += distance;
      ++found;
    }
    return found ? sum / static_cast<float>(found) : 0.0f;
  }

 private:
  struct Nearest {
    std::array<float, kNeighbors> distance;  // squared, ascending
  };
  void build(std::size_t begin, std::size_t end) {
    if (end - begin < 2) return;
    glm::vec3 low = points_[order_[begin]];
    glm::vec3 high = low;
    for (std::size_t i = begin; i < end; ++i) {
      low = glm::min(low, points_[order_[i]]);
      high = glm::max(high, points_[order_[i]]);
    }
    const glm::vec3 size = high - low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::size_t middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](std::uint32_t a, std::uint32_t b) { return points_[a][axis] < points_[b][axis]; });
    axis_[middle] = static_cast<std::uint8_t>(axis);
    build(begin, middle);
    build(middle + 1, end);
  }
  void search(std::size_t begin, std::size_t end, std::uint32_t query, Nearest& nearest) const {
    if (begin >= end) return;
    const std::size_t middle = begin + (end - begin) / 2;
    const std::uint32_t candidate = order_[middle];
    if (candidate != query) {
      const glm::vec3 offset = points_[candidate] - points_[query];
      float distance = glm::dot(offset, offset);
      for (float& slot : nearest.distance) {
        if (distance < slot) std::swap(distance, slot);
      }
    }
    if (end - begin == 1) return;
    const int axis = axis_[middle];
    const float offset = points_[query][axis] - points_[candidate][axis];
    const bool low_first = offset < 0;
    low_first ? search(begin, middle, query, nearest) : search(middle + 1, end, query, nearest);
    if (offset * offset < nearest.distance.back()) {
      low_first ? search(middle + 1, end, query, nearest) : search(begin, middle, query, nearest);
    }
  }
  std::span<const glm::vec3> points_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint8_t> axis_;
};

struct Cube {
  glm::dvec3 center{0.0};
  double half = 1.3;  // the Blender recipe of 3DGS
};

Cube startingCube(const Dataset& dataset) {
  if (dataset.layout == DatasetLayout::nerfSynthetic && !dataset.normalized) return {};
  const std::vector<Camera> views = trainingViews(dataset);
  Cube cube;
  cube.center = lookedAt(views);
  cube.half = 0;
  for (const Camera& view : views) {
    cube.half += glm::length(view.position() - cube.center) / static_cast<double>(views.size());
  }
  // Nearer than kNear nothing is drawn. So near to what they look at are also cameras that look from one place or along
  // parallel axes, which look at nothing in particular.
  if (!(cube.half >= 2.0 * kNear)) cube.half = 1.0;
  return cube;
}

}  // namespace

std::vector<float> meanSquaredNeighborDistance(std::span<const glm::vec3> points) {
  const NeighborTree tree(points);
  std::vector<float> result(points.size());
  parallelFor(static_cast<std::int64_t>(points.size()), 1024,
              [&](std::int64_t i) { result[i] = tree.meanSquaredDistance(static_cast<std::uint32_t>(i)); });
  return result;
}

GaussianModel gaussiansFromPoints(const PointCloud& points) {
  TG_ASSERT(points.color.size() == points.position.size(), "a colour a point");
  const std::size_t count = points.position.size();
  const std::vector<float> distance = meanSquaredNeighborDistance(points.position);
  GaussianModel model;
  resizeGaussians(model, count, 0);
  model.mean = points.position;
  for (std::size_t i = 0; i < count; ++i) {
    model.rotation[i] = glm::vec4(1, 0, 0, 0);
    model.log_scale[i] = glm::vec3(0.5f * std::log(std::max(distance[i], kMinSquaredDistance)));
    model.opacity_logit[i] = std::log(kFirstOpacity / (1 - kFirstOpacity));
    model.sh[i] = (points.color[i] - 0.5f) / kShC0;
  }
  return model;
}

PointCloud randomSubset(const PointCloud& points, std::size_t count, std::uint64_t seed) {
  TG_ASSERT(points.color.size() == points.position.size(), "a colour a point");
  if (points.position.size() <= count) return points;
  std::vector<std::uint32_t> order(points.position.size());
  std::iota(order.begin(), order.end(), 0u);
  Random random(seed);
  random.shuffle(order);
  order.resize(count);
  std::sort(order.begin(), order.end());
  PointCloud result;
  for (std::uint32_t i : order) {
    result.position.push_back(points.position[i]);
    result.color.push_back(points.color[i]);
  }
  return result;
}

PointCloud randomPoints(const Dataset& dataset, std::size_t count, std::uint64_t seed) {
  const Cube cube = startingCube(dataset);
  Random random(seed);
  const auto three = [&] {
    const double x = random.uniform();
    const double y = random.uniform();
    return glm::dvec3(x, y, random.uniform());
  };
  PointCloud points;
  for (std::size_t i = 0; i < count; ++i) {
    points.position.emplace_back(cube.center + cube.half * (2.0 * three() - 1.0));
    points.color.emplace_back(0.5 + double{kShC0} * three() / 255.0);
  }
  return points;
}

}  // namespace tg
