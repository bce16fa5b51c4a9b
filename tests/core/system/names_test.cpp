// SPDX-License-Identifier: Apache-2.0
// Enumerators by name, and numbers as text.
#include "core/system/names.h"

#include "core/system/numbers.h"
#include "support/catch.h"

namespace {

enum class Fruit { apple, sourCherry, pear };
constexpr auto namesOf(Fruit) { return tg::enumNames("apple", "sour-cherry", "pear"); }

}  // namespace

TEST_CASE("an enumerator has its name, and no other text is one", "[names]") {
  static_assert(tg::kCount<Fruit> == 3);
  static_assert(tg::name(Fruit::sourCherry) == "sour-cherry");
  static_assert(tg::parse<Fruit>("pear") == Fruit::pear);
  static_assert(!tg::parse<Fruit>("Pear"));
  // What name() asserts: the enumeration ends where its names do.
  static_assert(tg::isEnumerator<Fruit::pear>() && !tg::isEnumerator<static_cast<Fruit>(3)>());
  for (const Fruit fruit : tg::valuesOf<Fruit>()) CHECK(tg::parse<Fruit>(tg::name(fruit), "--fruit") == fruit);
  CHECK(tg::allNames<Fruit>() == "apple, sour-cherry or pear");
  CHECK(tg::allNames<Fruit>(", ") == "apple, sour-cherry, pear");
  CHECK_THROWS_WITH(tg::parse<Fruit>("plum", "--fruit"),
                    "--fruit: expected apple, sour-cherry or pear, found \"plum\"");
}

TEST_CASE("numbers are the whole text, in any locale and within their limits", "[names]") {
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
