// SPDX-License-Identifier: Apache-2.0
// The first Gaussians: neighbour distances, point colours, random starts.
#include "training/run/init.h"

#include <algorithm>

#include "shaders/shared/limits.h"
#include "support/catch.h"
#include "core/system/random.h"

TEST_CASE("neighbour distances equal brute force, also with duplicates and few points", "[init]") {
  tg::Random random(4);
  std::vector<glm::vec3> points;
  for (int i = 0; i < 500; ++i) {
    // Clustered along a line, so that the tree is uneven; every tenth point is doubled.
    const auto x = static_cast<float>(std::pow(random.uniform(), 4.0));
    points.emplace_back(x, 0.1 * random.normal(), 0.01 * random.normal());
    if (i % 10 == 0) points.push_back(points.back());
  }
  for (std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{3}, points.size()}) {
    const std::span<const glm::vec3> some(points.data(), count);
    const std::vector<float> result = tg::meanSquaredNeighborDistance(some);
    REQUIRE(result.size() == count);
    for (std::size_t i = 0; i < count; ++i) {
      std::vector<float> distances;
      for (std::size_t j = 0; j < count; ++j) {
        if (j != i) distances.push_back(glm::dot(some[i] - some[j], some[i] - some[j]));
      }
      std::sort(distances.begin(), distances.end());
      distances.resize(std::min<std::size_t>(distances.size(), 3));
      float sum = 0;
      for (float d : distances) sum += d;
      CHECK(result[i] == Approx(distances.empty() ? 0.0f : sum / static_cast<float>(distances.size())));
    }
  }
}

TEST_CASE("points become isotropic Gaussians in their colour, opacity 0.1", "[init]") {
  tg::PointCloud points;
  points.position = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}};
  points.color.assign(4, glm::vec3(0.25f, 0.5f, 1.0f));
  const tg::GaussianModel model = tg::gaussiansFromPoints(points);
  tg::checkModel(model, "points");
  CHECK(model.log_scale[0].x == Approx(std::log(2.0f)));
  CHECK(model.log_scale[0].y == model.log_scale[0].x);
  CHECK(1 / (1 + std::exp(-model.opacity_logit[3])) == Approx(0.1f));
  CHECK(model.sh[0].x * tg::kShC0 + 0.5f == Approx(0.25f));
  CHECK(model.sh_degree == 0);
}

TEST_CASE("a random subset keeps order, count and seed", "[init]") {
  tg::PointCloud points;
  for (int i = 0; i < 100; ++i) {
    points.position.emplace_back(i, 0, 0);
    points.color.emplace_back(0.5f);
  }
  const tg::PointCloud some = tg::randomSubset(points, 30, 5);
  REQUIRE(some.position.size() == 30);
  CHECK(std::is_sorted(some.position.begin(), some.position.end(), [](auto a, auto b) { return a.x < b.x; }));
  CHECK(some.position == tg::randomSubset(points, 30, 5).position);
  CHECK(some.position != tg::randomSubset(points, 30, 6).position);
  CHECK(tg::randomSubset(points, 200, 5).position.size() == 100);
}

TEST_CASE("without points Gaussians start where the cameras look", "[init]") {
  tg::Dataset dataset;
  for (double angle : {0.0, 1.5, 3.0, 4.5}) {
    const glm::dvec3 target(10, 20, 30);
    dataset.views.push_back(
        tg::lookAt(target + 4.0 * glm::dvec3(std::cos(angle), std::sin(angle), 0), target, {0, 0, 1}, 1, 8, 8));
  }
  dataset.layout = tg::DatasetLayout::transforms;
  const tg::PointCloud around = tg::randomPoints(dataset, 1000, 1);
  glm::dvec3 mean(0.0);
  for (glm::vec3 p : around.position) mean += glm::dvec3(p) / 1000.0;
  CHECK(glm::length(mean - glm::dvec3(10, 20, 30)) < 0.3);
  // A smaller scene, and one that lies before the near plane.
  tg::Dataset small = dataset;
  for (tg::Camera& view : small.views) view.translation *= 0.125;
  const tg::PointCloud scaled = tg::randomPoints(small, 1000, 1);
  for (std::size_t i = 0; i < 1000; ++i) CHECK(glm::length(scaled.position[i] - 0.125f * around.position[i]) < 1e-3f);
  for (tg::Camera& view : small.views) view.translation *= 0.1;
  float most = 0;
  for (glm::vec3 p : tg::randomPoints(small, 1000, 1).position) most = std::max(most, std::abs(p.x - 0.125f));
  CHECK(most > 0.9f);
  dataset.layout = tg::DatasetLayout::nerfSynthetic;
  for (glm::vec3 p : tg::randomPoints(dataset, 1000, 1).position) {
    CHECK(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= 1.3f);
  }
}
