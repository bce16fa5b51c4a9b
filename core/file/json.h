// SPDX-License-Identifier: Apache-2.0
// JSON input with bounds and with errors that name the member. Private to core: nlohmann/json is slow to compile.
#pragma once
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "core/system/error.h"

namespace tg {

constexpr int kMaxJsonDepth = 64;

// Throws Error(badData) on a syntax error, on deeper nesting than kMaxJsonDepth and on trailing text.
inline nlohmann::json parseJson(const std::string& text, const std::string& path) {
  const auto bounded = [&](int depth, nlohmann::json::parse_event_t, nlohmann::json&) {
    if (depth > kMaxJsonDepth)
      throw Error(ErrorKind::badData, path,
                  "JSON nests too deep (expected at most " + std::to_string(kMaxJsonDepth) + " levels)");
    return true;
  };
  try {
    return nlohmann::json::parse(text, bounded);
  } catch (const nlohmann::json::exception& e) {
    throw Error(ErrorKind::badData, path, std::string("not valid JSON: ") + e.what());
  }
}

// Text for a file; bytes that are no UTF-8 (from image names of another encoding) become U+FFFD.
inline std::string dumpJson(const nlohmann::ordered_json& value, int indent = -1) {
  return value.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

// One object of a file, for reading members: `where` precedes the key in messages ("camera 3: ").
struct JsonObject {
  const nlohmann::json& value;
  const std::string& path;
  std::string where;

  [[noreturn]] void fail(const std::string& what) const { throw Error(ErrorKind::badData, path, where + what); }
  bool has(const char* key) const { return value.contains(key); }
  const nlohmann::json& member(const char* key) const {
    if (!value.is_object()) fail(std::string("expected an object, found ") + value.type_name());
    const auto found = value.find(key);
    if (found == value.end()) fail(std::string("missing key \"") + key + "\"");
    return *found;
  }
  double number(const char* key) const { return finite(member(key), key); }
  double finite(const nlohmann::json& v, const std::string& key) const {
    if (!v.is_number()) fail("\"" + key + "\": expected a number, found " + v.type_name());
    const double d = v.get<double>();
    if (!std::isfinite(d)) fail("\"" + key + "\": expected a finite number");
    return d;
  }
  std::int64_t integer(const char* key, std::int64_t low, std::int64_t high) const {
    const double d = number(key);
    if (d != std::floor(d) || d < static_cast<double>(low) || d > static_cast<double>(high))
      fail(std::string("\"") + key + "\": expected an integer from " + std::to_string(low) + " to " +
           std::to_string(high) + ", found " + member(key).dump());
    return static_cast<std::int64_t>(d);
  }
  std::string string(const char* key) const {
    const nlohmann::json& v = member(key);
    if (!v.is_string()) fail(std::string("\"") + key + "\": expected a string, found " + v.type_name());
    return v.get<std::string>();
  }
  // An array of exactly `count` elements.
  const nlohmann::json& array(const char* key, std::size_t count) const {
    const nlohmann::json& v = member(key);
    if (!v.is_array() || v.size() != count)
      fail(std::string("\"") + key + "\": expected an array of " + std::to_string(count));
    return v;
  }
};

}  // namespace tg
