// SPDX-License-Identifier: Apache-2.0
// The order in which views are learnt from.
#include "training/step/run_state.h"

#include <algorithm>
#include <set>

#include "support/catch.h"

TEST_CASE("every view comes once before any comes again, each time in another order") {
  for (const std::size_t count : {1, 2, 7, 8}) {
    tg::ViewOrder order;
    for (std::size_t i = 0; i < count; ++i) order.views.push_back(static_cast<std::uint32_t>(i));
    order.random = tg::Random(3);
    std::set<std::vector<std::size_t>> orders;
    for (int round = 0; round < 5; ++round) {
      std::vector<std::size_t> seen;
      for (std::size_t i = 0; i < count; ++i) {
        const std::optional<std::size_t> told = order.following();
        seen.push_back(order.next());
        CHECK(told.value_or(seen.back()) == seen.back());
        CHECK(told.has_value() == (i > 0));
      }
      orders.insert(seen);
      std::ranges::sort(seen);
      for (std::size_t i = 0; i < count; ++i) CHECK(seen[i] == i);
    }
    CHECK(orders.size() >= (count < 7 ? 1 : 5));
  }
}
