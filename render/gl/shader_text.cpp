// SPDX-License-Identifier: Apache-2.0
#include "render/gl/shader_text.h"

#include <regex>

namespace tg {

std::string specialized(std::string_view text, std::span<const std::uint32_t> constants) {
  static const std::regex declaration(
      R"(layout\(\s*(?:(constant_id)|(local_size_x_id))\s*=\s*(\d+)\s*\)\s*(?:const (\w+) (\w+) = ([^;]*);|in;))");
  const std::string all(text);
  std::string result;
  auto rest = all.cbegin();
  for (std::sregex_iterator match(all.begin(), all.end(), declaration), end; match != end; ++match) {
    const std::smatch& m = *match;
    const std::size_t id = std::stoul(m[3]);
    const bool given = id < constants.size();
    result.append(rest, m[0].first);
    rest = m[0].second;
    if (m[2].matched) {
      result += "layout(local_size_x = " + std::to_string(given ? constants[id] : 1) + ") in;";
    } else {
      const std::string value = given ? m[4].str() + "(" + std::to_string(constants[id]) + "u)" : m[6].str();
      result += "const " + m[4].str() + " " + m[5].str() + " = " + value + ";";
    }
  }
  result.append(rest, all.cend());
  return result;
}

}  // namespace tg
