// SPDX-License-Identifier: Apache-2.0
// Names of enumerators, written once, beside the enumeration and in its order; its values count from 0:
//   enum class Fruit { apple, sourCherry };
//   constexpr auto namesOf(Fruit) { return enumNames("apple", "sour-cherry"); }
#pragma once
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include "core/system/error.h"

namespace tg {

template <typename... Texts>
constexpr std::array<std::string_view, sizeof...(Texts)> enumNames(Texts... texts) {
  return {texts...};
}

template <typename E>
concept Named = std::is_enum_v<E> && requires { namesOf(E{}); };

// Whether there is an enumerator of this value: compilers write others as a cast, "(Fruit)2".
template <auto kValue>
constexpr bool isEnumerator() {
  const std::string_view text = __PRETTY_FUNCTION__;  // "... [with auto kValue = tg::Fruit::apple]"
  const std::size_t bracket = text.rfind(')');
  return bracket < text.rfind('=') || text[bracket + 1] == ':';  // clang: "(anonymous namespace)::Fruit::apple"
}

template <Named E>
constexpr int kCount = static_cast<int>(namesOf(E{}).size());

template <Named E>
constexpr std::string_view name(E value) {
  constexpr auto names = namesOf(E{});
  static_assert(isEnumerator<static_cast<E>(names.size() - 1)>() && !isEnumerator<static_cast<E>(names.size())>(),
                "expected one name for each enumerator");
  return names.at(static_cast<std::size_t>(value));
}

// All enumerators, in order.
template <Named E>
constexpr auto valuesOf() {
  std::array<E, kCount<E>> values{};
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<E>(i);
  return values;
}

// Nothing for a text that is no name.
template <Named E>
constexpr std::optional<E> parse(std::string_view text) {
  for (const E value : valuesOf<E>()) {
    if (name(value) == text) return value;
  }
  return std::nullopt;
}

// "apple or sour-cherry"; with more than two, commas between the first ones.
template <Named E>
std::string allNames(std::string_view last = " or ") {
  std::string text;
  for (const E value : valuesOf<E>()) {
    const int index = static_cast<int>(value);
    text += index == 0 ? "" : index + 1 == kCount<E> ? last : ", ";
    text += name(value);
  }
  return text;
}

// Throws Error(usage): `what: expected apple or sour-cherry, found "text"`.
template <Named E>
E parse(std::string_view text, const std::string& what) {
  const std::optional<E> value = parse<E>(text);
  if (value) return *value;
  throw Error(ErrorKind::usage, what + ": expected " + allNames<E>() + ", found \"" + std::string(text) + "\"");
}

}  // namespace tg
