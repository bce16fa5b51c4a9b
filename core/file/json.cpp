// SPDX-License-Identifier: Apache-2.0
// JSON input with bounds, and with errors that name the file and the place in it.
#include "core/file/json.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "core/system/shortened.h"

namespace tg {
namespace {

std::string inQuotes(std::string_view key) { return std::string("\"").append(key).append("\""); }

// Levels of brackets outside of strings.
bool nestsTooDeep(std::string_view text) {
  int depth = 0;
  bool inside = false;  // a string
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (inside) {
      if (c == '\\') ++i;
      inside = c != '"';
    } else if (c == '"') {
      inside = true;
    } else if (c == '[' || c == '{') {
      if (++depth > kMaxJsonDepth) return true;
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  return false;
}

// "line 3, column 14" of the byte, counted from 1, with which a text stops being JSON.
std::string placeOf(std::string_view text, std::size_t byte) {
  const std::string_view before = text.substr(0, byte > 0 ? byte - 1 : 0);
  const std::size_t line = static_cast<std::size_t>(std::ranges::count(before, '\n')) + 1;
  const std::size_t start = before.rfind('\n');
  const std::size_t column = start == std::string_view::npos ? before.size() + 1 : before.size() - start;
  std::string place = "line " + std::to_string(line) + ", column " + std::to_string(column);
  return before.size() < text.size() ? place : place + ", where it ends";
}

// Where `part` first stands beyond keys and strings; text.size() where it does not.
std::size_t outsideStrings(std::string_view text, std::string_view part) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text.substr(i).starts_with(part)) return i;
    if (text[i] != '"') continue;
    for (++i; i < text.size() && text[i] != '"'; ++i) {
      if (text[i] == '\\') ++i;
    }
  }
  return text.size();
}

}  // namespace

nlohmann::json parseJson(std::string_view text, const std::string& path, const JsonWords& words) {
  constexpr std::string_view kSpace = " \t\r\n", kStarts = "{[\"-0123456789tfn\xef";  // the last: a byte order mark
  const std::size_t start = text.find_first_not_of(kSpace);
  if (start != std::string_view::npos && kStarts.find(text[start]) == std::string_view::npos) {
    throw Error(ErrorKind::badData, path, std::string(words.broken) + placeOf(text, start + 1));
  }
  // The library would count levels by a callback, with which it looks at all elements of an array after each of them.
  if (nestsTooDeep(text)) throw Error(ErrorKind::badData, path, words.deep);
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::parse_error& e) {
    throw Error(ErrorKind::badData, path, std::string(words.broken) + placeOf(text, e.byte));
  } catch (const nlohmann::json::out_of_range& e) {
    const std::string what = e.what();  // "[...] number overflow parsing '1e999'"
    const std::size_t quote = what.find('\'');
    const std::string number = quote == what.npos ? "" : what.substr(quote + 1, what.size() - quote - 2);
    throw Error(ErrorKind::badData, path,
                std::string(words.broken) + placeOf(text, outsideStrings(text, number) + 1) + ": number out of range" +
                    expectedFound("a magnitude of at most 1.8e308", shortened(number, 20, 10)));
  } catch (const nlohmann::json::exception& e) {
    throw Error(ErrorKind::badData, path, std::string(words.broken) + shortened(e.what()));
  }
}

nlohmann::json parseJson(std::span<const std::uint8_t> text, const std::string& path, const JsonWords& words) {
  return parseJson(std::string_view(reinterpret_cast<const char*>(text.data()), text.size()), path, words);
}

std::string dumpJson(const nlohmann::ordered_json& value, int indent) {
  return value.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

void requireUtf8(const std::string& text, const std::string& file) {
  try {
    (void)nlohmann::json(text).dump();
  } catch (const nlohmann::json::type_error&) {
    throw Error(ErrorKind::badData, printable(text), "is no UTF-8, which " + file + " is written in");
  }
}

void JsonNode::fail(const std::string& what) const {
  throw Error(ErrorKind::badData, path, (place.empty() ? "" : shortened(place) + ": ") + shortened(what));
}

bool JsonNode::has(const char* key) const { return value.contains(key); }
std::size_t JsonNode::size() const { return value.size(); }

const nlohmann::json& JsonNode::member(const char* key) const {
  if (!value.is_object()) fail(std::string("expected an object, found ") + value.type_name());
  const auto found = value.find(key);
  if (found == value.end()) fail("missing key " + inQuotes(key));
  return *found;
}

double JsonNode::finite(const nlohmann::json& number, const std::string& key) const {
  if (!number.is_number()) fail(inQuotes(key) + ": expected a number, found " + number.type_name());
  const double d = number.get<double>();
  if (!std::isfinite(d)) fail(inQuotes(key) + ": expected a finite number");
  return d;
}

double JsonNode::number(const char* key) const { return finite(member(key), key); }
double JsonNode::number(const char* key, double low, double high) const { return within(member(key), key, low, high); }

double JsonNode::within(const nlohmann::json& number, const char* key, double low, double high) const {
  const double d = finite(number, key);
  if (!(d >= low && d <= high)) {
    char limits[64];
    std::snprintf(limits, sizeof limits, "%g to %g", low, high);
    fail(inQuotes(key) + ": expected " + limits + ", found " + number.dump());
  }
  return d;
}

std::int64_t JsonNode::integer(const char* key, std::int64_t low, std::int64_t high) const {
  const double d = number(key);
  if (d != std::floor(d) || d < static_cast<double>(low) || d > static_cast<double>(high)) {
    const std::string range = "an integer from " + std::to_string(low) + " to " + std::to_string(high);
    fail(inQuotes(key) + ": expected " + (low == high ? std::to_string(low) : range) + ", found " + member(key).dump());
  }
  return static_cast<std::int64_t>(d);
}

template <typename T>
T JsonNode::typed(const char* key, const char* what) const {
  const nlohmann::json& v = member(key);
  const T* found = v.get_ptr<const T*>();
  if (!found) fail(inQuotes(key) + ": expected " + what + ", found " + v.type_name());
  return *found;
}

bool JsonNode::boolean(const char* key) const { return typed<bool>(key, "true or false"); }
std::string JsonNode::string(const char* key) const { return typed<std::string>(key, "a string"); }

const nlohmann::json& JsonNode::array(const char* key, std::size_t count) const {
  const nlohmann::json& v = member(key);
  if (!v.is_array() || v.size() != count) fail(inQuotes(key) + ": expected an array of " + std::to_string(count));
  return v;
}

const nlohmann::json& JsonNode::list(const char* key, std::size_t most) const {
  const nlohmann::json& v = member(key);
  if (!v.is_array() || v.size() > most) fail(inQuotes(key) + ": expected an array of at most " + std::to_string(most));
  return v;
}

void JsonNode::readNumbers(const char* key, std::span<double> values, double low, double high) const {
  const nlohmann::json& from = array(key, values.size());
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = within(from[i], key, low, high);
}

JsonNode JsonNode::at(const std::string& key) const {
  const auto found = value.is_object() ? value.find(key) : value.end();
  if (found == value.end()) fail(inQuotes(key) + " is missing");
  return {*found, path, below(key)};
}

JsonNode JsonNode::element(std::size_t i) const { return {value[i], path, below(std::to_string(i))}; }
std::string JsonNode::below(const std::string& key) const { return (place == "/" ? place : place + "/") + key; }

void JsonNode::expect(bool is, const char* what) const {
  if (!is) fail("wrong type" + expectedFound(what, shown()));
}

JsonNode JsonNode::object() const { return expect(value.is_object(), "an object"), *this; }
JsonNode JsonNode::array() const { return expect(value.is_array(), "an array"), *this; }
std::string JsonNode::string() const { return expect(value.is_string(), "a string"), value.get<std::string>(); }

std::uint64_t JsonNode::size64() const {
  if (!value.is_number_unsigned()) fail("wrong value" + expectedFound("an integer >= 0", shown()));
  return value.get<std::uint64_t>();
}

std::uint64_t JsonNode::size64(const char* key, std::uint64_t otherwise) const {
  return has(key) ? at(key).size64() : otherwise;
}

std::uint64_t JsonNode::index(std::size_t count, const char* of) const {
  const std::uint64_t i = size64();
  if (i >= count) {
    fail("no such " + std::string(of) + expectedFound("an index below " + std::to_string(count), std::to_string(i)));
  }
  return i;
}

void JsonNode::expectNumbers(std::size_t count) const {
  array();
  if (size() != count || !std::ranges::all_of(value, [](const nlohmann::json& v) { return v.is_number(); })) {
    fail("wrong value" + expectedFound(std::to_string(count) + " numbers", shown()));
  }
}

std::string JsonNode::shown() const {
  std::string text = value.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  return text.size() > 40 ? text.substr(0, 37) + "..." : text;
}

}  // namespace tg
