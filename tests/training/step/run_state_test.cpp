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

TEST_CASE("the report of a stage is the one that was set for it, and that of the plain stage is always there") {
  tg::TrainReport report;
  for (const tg::Stage stage : tg::valuesOf<tg::Stage>()) {
    CHECK((tg::reportOf(report, stage) != nullptr) == (stage == tg::Stage::plain));
    tg::StageReport to_set;
    to_set.iterations = 10 + static_cast<int>(stage);
    tg::setReport(report, stage, to_set);
  }
  for (const tg::Stage stage : tg::valuesOf<tg::Stage>()) {
    const tg::StageReport* set = tg::reportOf(report, stage);
    REQUIRE(set != nullptr);
    CHECK(set->iterations == 10 + static_cast<int>(stage));
  }
}
