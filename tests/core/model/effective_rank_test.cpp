// SPDX-License-Identifier: Apache-2.0
// Needles, flat and round ones, at scales whose exponential overflows, too.
#include "core/model/effective_rank.h"

#include <cmath>
#include <vector>

#include "support/catch.h"

TEST_CASE("the effective rank counts the axes that matter") {
  const auto rank = [](double x, double y, double z) {
    return tg::effectiveRank(
        {static_cast<float>(std::log(x)), static_cast<float>(std::log(y)), static_cast<float>(std::log(z))});
  };
  CHECK(rank(1, 1, 1) == Approx(3));
  CHECK(rank(1e-9, 5, 5) == Approx(2));
  CHECK(rank(1e-9, 5, 1e-9) == Approx(1));
  CHECK(rank(1e-15, 1e-15, 1e-15) == Approx(3));  // whatever the size
  // Squared shares 4/6, 1/6, 1/6.
  const double entropy = -(4.0 / 6 * std::log(4.0 / 6) + 2 * (1.0 / 6) * std::log(1.0 / 6));
  CHECK(rank(1, 2, 1) == Approx(std::exp(entropy)).epsilon(1e-6));
  CHECK(tg::effectiveRank({300, -300, 300}) == Approx(2));  // exp would overflow

  const float small = -20;
  const std::vector<glm::vec3> scales = {{0, small, small}, {0, small, 0}, {small, 0, 0}, {0, 0, 0}};
  const tg::EffectiveRanks ranks = tg::effectiveRanks(scales);
  CHECK(ranks.count == 4);
  CHECK(ranks.needle == 0.25);
  CHECK(ranks.flat == 0.5);
  CHECK(ranks.round == 0.25);
  CHECK(ranks.mean == Approx(2));
  CHECK(ranks.bins.front() == 1);
  CHECK(ranks.bins.back() == 1);  // 3 itself belongs to the last bin
  std::size_t total = 0;
  for (std::size_t bin : ranks.bins) total += bin;
  CHECK(total == 4);
  CHECK(tg::effectiveRanks({}).count == 0);
}
