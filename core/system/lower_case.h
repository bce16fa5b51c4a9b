// SPDX-License-Identifier: Apache-2.0
// Names and extensions are compared without regard to case: of ASCII, whatever the locale.
#pragma once
#include <string>

namespace tg {

inline std::string lowerCase(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

}  // namespace tg
