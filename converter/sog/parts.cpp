// SPDX-License-Identifier: Apache-2.0
// What the reader and the writer of SOG files agree on.
#include "converter/sog/parts.h"

#include <map>
#include <utility>

namespace tg::sog {

std::vector<SizeClass> sizeClasses(std::span<const TextureRect> rects) {
  std::map<std::pair<int, int>, std::vector<std::uint32_t>> by_size;
  for (std::size_t i = 0; i < rects.size(); ++i) {
    if (rects[i].texelCount() == 0) continue;
    by_size[{rects[i].height, rects[i].width}].push_back(static_cast<std::uint32_t>(i));
  }
  std::vector<SizeClass> classes;
  for (auto& [size, textures] : by_size) classes.push_back({size.second, size.first, std::move(textures)});
  return classes;
}

}  // namespace tg::sog
