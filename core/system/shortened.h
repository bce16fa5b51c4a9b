// SPDX-License-Identifier: Apache-2.0
// Text of a file in a message: it may be as long as the file.
#pragma once
#include <cstddef>
#include <string>

namespace tg {

// Beginning and end of what is too long for a line that somebody reads.
inline std::string shortened(const std::string& text, std::size_t first = 200, std::size_t last = 100) {
  if (text.size() <= first + last + 3) return text;
  return text.substr(0, first) + "..." + text.substr(text.size() - last);
}

}  // namespace tg
