// SPDX-License-Identifier: Apache-2.0
// Numbers as text.
#include "core/system/numbers.h"

#include <array>

#include "support/catch.h"

TEST_CASE("numbers are the whole text, in any locale and within their limits", "[numbers]") {
  CHECK(tg::parseWhole<int>("12") == 12);
  for (const char* bad : {"", " 1", "1 ", "1.5", "+1", "x"}) CHECK_FALSE(tg::parseWhole<int>(bad));
  CHECK(tg::numberText(0.2f) == "0.2");
  std::array<float, 3> values{};
  CHECK(tg::parseList<float>("1,-2.5,3e2", values));
  CHECK(values == std::array<float, 3>{1, -2.5f, 300});
  for (const char* bad : {"", "1,2", "1,2,", "1,2,3,", "1,2,3,4", ",,", "1;2;3"}) {
    CHECK_FALSE(tg::parseList<float>(bad, values));
  }
  CHECK(tg::parseNumber("10", 0, 10, "--x") == 10);
  CHECK_THROWS_WITH(tg::parseNumber("11", 0.01, 10, "--x"), "--x: expected a number from 0.01 to 10, found \"11\"");
}
