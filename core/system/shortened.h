// SPDX-License-Identifier: Apache-2.0
// Text of a file in a message: it may be as long as the file.
#pragma once
#include <cstddef>
#include <string>

namespace tg {

// Beginning and end [bytes] of what is too long for a line that somebody reads, cut between characters of UTF-8.
inline std::string shortened(const std::string& text, std::size_t first = 200, std::size_t last = 100) {
  if (text.size() <= first + last + 3) return text;
  const auto continues = [&](std::size_t at) { return (static_cast<unsigned char>(text[at]) & 0xC0) == 0x80; };
  std::size_t end = first, start = text.size() - last;
  for (int k = 0; k < 3 && end > 0 && continues(end); ++k) --end;
  for (int k = 0; k < 3 && start < text.size() && continues(start); ++k) ++start;
  return text.substr(0, end) + "..." + text.substr(start);
}

}  // namespace tg
