// SPDX-License-Identifier: Apache-2.0
// Enumerators by name.
#include "core/system/names.h"

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
