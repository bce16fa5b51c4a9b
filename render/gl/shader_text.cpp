// SPDX-License-Identifier: Apache-2.0
// Finds the constants' declarations in the text and puts numbers into them.
#include "render/gl/shader_text.h"

#include <algorithm>
#include <optional>

namespace tg {
namespace {

bool isSpace(char c) { return std::string_view(" \t\n\v\f\r").find(c) != std::string_view::npos; }
bool isDigit(char c) { return c >= '0' && c <= '9'; }
bool isWord(char c) { return isDigit(c) || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool isValue(char c) { return c != ';'; }

// The text that is still to be read.
struct Rest {
  std::string_view text;

  bool take(std::string_view word) {
    if (!text.starts_with(word)) return false;
    text.remove_prefix(word.size());
    return true;
  }
  std::string_view takeAll(bool (*is)(char)) {
    const auto end = std::find_if_not(text.begin(), text.end(), is);
    const std::string_view taken(text.begin(), end);
    text.remove_prefix(taken.size());
    return taken;
  }
};

// `layout(constant_id = ID) const TYPE NAME = VALUE;`, or `layout(local_size_x_id = ID) in;`, which has the id alone.
struct Declaration {
  std::size_t id = 0;
  std::string_view type, name, value;
};

std::optional<Declaration> takeDeclaration(Rest& rest) {
  rest.take("layout(");
  rest.takeAll(isSpace);
  const bool constant = rest.take("constant_id");
  if (!constant && !rest.take("local_size_x_id")) return std::nullopt;
  rest.takeAll(isSpace);
  if (!rest.take("=")) return std::nullopt;
  rest.takeAll(isSpace);
  const std::string_view id = rest.takeAll(isDigit);
  rest.takeAll(isSpace);
  if (id.empty() || !rest.take(")")) return std::nullopt;
  rest.takeAll(isSpace);
  Declaration found{std::stoul(std::string(id)), {}, {}, {}};
  if (!constant) return rest.take("in;") ? std::optional(found) : std::nullopt;
  if (!rest.take("const ")) return std::nullopt;
  found.type = rest.takeAll(isWord);
  if (!rest.take(" ")) return std::nullopt;
  found.name = rest.takeAll(isWord);
  if (found.type.empty() || found.name.empty() || !rest.take(" = ")) return std::nullopt;
  found.value = rest.takeAll(isValue);
  return rest.take(";") ? std::optional(found) : std::nullopt;
}

}  // namespace

std::string specialized(std::string_view text, std::span<const std::uint32_t> constants) {
  std::string result;
  while (true) {
    const std::size_t at = std::min(text.find("layout("), text.size());
    result += text.substr(0, at);
    text.remove_prefix(at);
    if (text.empty()) return result;
    Rest rest{text};
    const std::optional<Declaration> found = takeDeclaration(rest);
    if (!found) {
      result += text.front();
      text.remove_prefix(1);
      continue;
    }
    text = rest.text;
    const bool given = found->id < constants.size();
    if (found->type.empty()) {
      result += "layout(local_size_x = " + std::to_string(given ? constants[found->id] : 1) + ") in;";
      continue;
    }
    const std::string type(found->type);
    result += "const " + type + " " + std::string(found->name) + " = ";
    result += given ? type + "(" + std::to_string(constants[found->id]) + "u)" : std::string(found->value);
    result += ";";
  }
}

}  // namespace tg
