// SPDX-License-Identifier: Apache-2.0
// A Hilbert curve never jumps.
#include "converter/formats/space_curve.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "support/catch.h"

using namespace tg;

TEST_CASE("the curve goes through all cells of a grid, from each to one that touches it", "[curve]") {
  constexpr int side = 16;
  std::vector<glm::vec3> cells;
  for (int k = 0; k < side * side * side; ++k) cells.emplace_back(k % side, k / side % side, k / side / side);
  std::vector<std::uint32_t> order = hilbertOrder(cells);
  REQUIRE(order.size() == cells.size());
  // The grid's last cells lie on the cube's far faces: what is next to each other on the curve is a cell away.
  std::vector<int> steps;
  for (std::size_t k = 1; k < order.size(); ++k) {
    const glm::vec3 step = glm::abs(cells[order[k]] - cells[order[k - 1]]);
    steps.push_back(static_cast<int>(step.x + step.y + step.z));
  }
  CHECK(std::ranges::count(steps, 1) == std::ssize(steps));
  std::ranges::sort(order);
  CHECK(std::ranges::adjacent_find(order) == order.end());
}

TEST_CASE("places outside the cube, and those that are none, have codes too", "[curve]") {
  CHECK(hilbertCode(glm::dvec3(-1)) == hilbertCode(glm::dvec3(0)));
  CHECK(hilbertCode(glm::dvec3(0)) == 0);
  CHECK(hilbertCode(glm::dvec3(2)) == hilbertCode(glm::dvec3(1)));
  const std::vector<glm::vec3> same(5, glm::vec3(1, 2, 3));
  CHECK(hilbertOrder(same) == std::vector<std::uint32_t>{0, 1, 2, 3, 4});
}
