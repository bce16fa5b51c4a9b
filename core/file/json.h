// SPDX-License-Identifier: Apache-2.0
// JSON input with bounds, and with errors that name the file and the place in it. nlohmann/json.hpp is slow to compile:
// a source that looks into values includes it itself.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>

namespace tg {

constexpr int kMaxJsonDepth = 64;

// How the errors of parseJson begin: a format's own words.
struct JsonWords {
  std::string_view broken = "not valid JSON: ";
  std::string deep = "JSON nests too deep (expected at most " + std::to_string(kMaxJsonDepth) + " levels)";
};

// Throws Error(badData) on a syntax error, on deeper nesting than kMaxJsonDepth and on trailing text.
nlohmann::json parseJson(std::string_view text, const std::string& path, const JsonWords& words = {});
nlohmann::json parseJson(std::span<const std::uint8_t> text, const std::string& path, const JsonWords& words = {});

// Text for a file; bytes that are no UTF-8 (from image names of another encoding) become U+FFFD.
std::string dumpJson(const nlohmann::ordered_json& value, int indent = -1);
// For names that must come back as they are. Throws Error(badData) that names the file which could not hold the text.
void requireUtf8(const std::string& text, const std::string& file);

// A value of a file. Getters throw Error(badData) that says where it stands, what was expected and what was found.
// `value` and `path` must outlive it.
struct JsonNode {
  const nlohmann::json& value;
  const std::string& path;  // of the file
  std::string place;        // "camera 3", or a JSON pointer ("/" for its root); "" says nothing

  [[noreturn]] void fail(const std::string& what) const;
  bool has(const char* key) const;
  std::size_t size() const;

  // Of an object: what `key` holds. Numbers are finite and within their limits.
  const nlohmann::json& member(const char* key) const;
  double number(const char* key) const;
  double number(const char* key, double low, double high) const;
  std::int64_t integer(const char* key, std::int64_t low, std::int64_t high) const;
  bool boolean(const char* key) const;
  std::string string(const char* key) const;
  const nlohmann::json& array(const char* key, std::size_t count) const;  // of exactly `count` elements
  const nlohmann::json& list(const char* key, std::size_t most) const;
  double finite(const nlohmann::json& number, const std::string& key) const;  // one of an array's, say
  template <std::size_t N>
  std::array<double, N> numbers(const char* key, double low = -std::numeric_limits<double>::infinity(),
                                double high = std::numeric_limits<double>::infinity()) const {
    std::array<double, N> values;
    readNumbers(key, values, low, high);
    return values;
  }

  // The value itself and what is below it, for documents whose places are JSON pointers.
  JsonNode at(const std::string& key) const;
  JsonNode element(std::size_t i) const;
  JsonNode object() const;
  JsonNode array() const;
  std::string string() const;
  std::uint64_t size64() const;                                          // an integer >= 0
  std::uint64_t size64(const char* key, std::uint64_t otherwise) const;  // of a key that may be absent
  std::uint64_t index(std::size_t count, const char* of) const;          // below `count`; `of` names what is counted
  void expectNumbers(std::size_t count) const;                           // an array of them
  std::string shown() const;                                             // short, for a message

 private:
  template <typename T>
  T typed(const char* key, const char* what) const;
  void expect(bool is, const char* what) const;
  std::string below(const std::string& key) const;  // its place
  double within(const nlohmann::json& number, const char* key, double low, double high) const;
  void readNumbers(const char* key, std::span<double> values, double low, double high) const;
};

}  // namespace tg
