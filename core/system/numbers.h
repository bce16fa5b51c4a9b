// SPDX-License-Identifier: Apache-2.0
// Numbers as text, of flags, settings and scripts. In the C locale, whatever the user's is.
#pragma once
#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

namespace tg {

// The number that is the whole text, or nothing.
template <typename T>
std::optional<T> parseWhole(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// As many numbers as `values` holds, with a comma between two. False for any other text.
template <typename T>
bool parseList(std::string_view text, std::span<T> values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t end = i + 1 < values.size() ? text.find(',') : text.size();
    if (end == std::string_view::npos) return false;
    const std::optional<T> value = parseWhole<T>(text.substr(0, end));
    if (!value) return false;
    values[i] = *value;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return true;
}

// "white", "black" or "r,g,b", each in [0, 1].
inline std::optional<std::array<float, 3>> parseColor(std::string_view text) {
  if (text == "white") return std::array{1.0f, 1.0f, 1.0f};
  std::array<float, 3> color{};
  const auto inside = [](float x) { return x >= 0 && x <= 1; };
  if (text == "black" || (parseList<float>(text, color) && std::ranges::all_of(color, inside))) return color;
  return std::nullopt;
}

// The shortest text that reads back as the same number.
template <typename T>
std::string numberText(T value) {
  char text[64];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

// What JSON shows of a float without digits that mean nothing: reads back as the same float.
inline double shortDouble(float value) {
  const std::string text = numberText(value);
  double number = 0.0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

// As printf; 255 characters of it.
template <typename... Values>
std::string formatted(const char* pattern, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

// Error(usage): `what: expected X, found "text"`.
[[noreturn]] void refuseValue(const std::string& what, const std::string& text, const std::string& expected);
// These throw it. Finite; from `low` to `high`.
double parseNumber(const std::string& text, const std::string& what);
double parseNumber(const std::string& text, double low, double high, const std::string& what);

}  // namespace tg
