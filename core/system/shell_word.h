// SPDX-License-Identifier: Apache-2.0
// Names in commands that messages suggest.
#pragma once
#include <string>

namespace tg {

// A name as a POSIX shell reads it back: as it is where that is safe, else in single quotes.
inline std::string shellWord(const std::string& name) {
  constexpr const char* kSafe = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_@%+=:,./-";
  if (!name.empty() && name.find_first_not_of(kSafe) == std::string::npos) return name;
  std::string word = "'";
  for (const char c : name) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

}  // namespace tg
