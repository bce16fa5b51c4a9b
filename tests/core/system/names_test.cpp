// SPDX-License-Identifier: Apache-2.0
// Enumerators by name.
#include "core/system/names.h"
#include "core/system/shell_word.h"

#include <string>

#include "core/system/shortened.h"

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

TEST_CASE("text is shortened between characters", "[names]") {
  std::string text;
  for (int i = 0; i < 200; ++i) text += "\u00e4";  // two bytes
  CHECK(tg::shortened(text) == std::string(text, 0, 200) + "..." + text.substr(300));
  const std::string odd = "x" + text + "x";
  CHECK(tg::shortened(odd) == std::string(odd, 0, 199) + "..." + odd.substr(303));
  CHECK(tg::shortened(odd, 4, 3) == "x\u00e4...\u00e4x");
  CHECK(tg::shortened(std::string(400, '\xbf')).size() <= 303);  // no UTF-8 at all
}

TEST_CASE("names in suggested commands are what a shell reads", "[core]") {
  CHECK(tg::shellWord("a/b-1.tgz") == "a/b-1.tgz");
  CHECK(tg::shellWord("ph otos") == "'ph otos'");
  CHECK(tg::shellWord("it's") == "'it'\\''s'");
  CHECK(tg::shellWord("") == "''");
}
