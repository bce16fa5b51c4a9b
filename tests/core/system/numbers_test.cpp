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

TEST_CASE("colours have a name or three numbers from 0 to 1", "[numbers]") {
  CHECK(tg::parseColor("white") == std::array{1.0f, 1.0f, 1.0f});
  CHECK(tg::parseColor("black") == std::array{0.0f, 0.0f, 0.0f});
  CHECK(tg::parseColor("0.5,0,1") == std::array{0.5f, 0.0f, 1.0f});
  for (const char* text : {"", "grey", "1,1", "1,1,1,1", "0.5;0;1", "2,0,0", "0,0,nan", "1, 1, 1"}) {
    CHECK_FALSE(tg::parseColor(text));
  }
}
