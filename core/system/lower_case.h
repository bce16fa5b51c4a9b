// SPDX-License-Identifier: Apache-2.0
// Names and extensions are compared without regard to case: of ASCII, whatever the locale.
#pragma once
#include <filesystem>
#include <string>

namespace tg {

inline std::string lowerCase(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}
// With its dot.
inline std::string lowerExtension(const std::filesystem::path& path) { return lowerCase(path.extension().string()); }

}  // namespace tg
