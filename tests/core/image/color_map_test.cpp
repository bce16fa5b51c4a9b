// SPDX-License-Identifier: Apache-2.0
// Colour maps against the colours that their authors publish.
#include "core/image/color_map.h"

#include <limits>
#include <string>

#include "support/catch.h"

using namespace tg;

namespace {

std::string hex(ColorMap map, float x) {
  const glm::ivec3 c(glm::round(255.0f * colorOf(map, x)));
  char text[8];
  std::snprintf(text, sizeof text, "#%02x%02x%02x", static_cast<unsigned>(c.x), static_cast<unsigned>(c.y),
                static_cast<unsigned>(c.z));
  return text;
}

}  // namespace

TEST_CASE("colour maps have the published colours at their ends and in the middle") {
  CHECK(hex(ColorMap::turbo, 0) == "#30123b");
  CHECK(hex(ColorMap::turbo, 1) == "#7a0403");
  CHECK(hex(ColorMap::viridis, 0) == "#440154");
  CHECK(hex(ColorMap::viridis, 128.0f / 255) == "#21918c");
  CHECK(hex(ColorMap::viridis, 1) == "#fde725");
  CHECK(hex(ColorMap::magma, 0) == "#000004");
  CHECK(hex(ColorMap::magma, 1) == "#fcfdbf");
  CHECK(hex(ColorMap::heat, 1.0f / 3) == "#ff0000");
  CHECK(hex(ColorMap::grey, 0.2f) == "#333333");
}

TEST_CASE("colours beyond the ends of a map are those of its ends") {
  for (const ColorMap map : {ColorMap::grey, ColorMap::heat, ColorMap::turbo, ColorMap::viridis, ColorMap::magma}) {
    CHECK(colorOf(map, -1) == colorOf(map, 0));
    CHECK(colorOf(map, 7) == colorOf(map, 1));
    CHECK(colorOf(map, std::numeric_limits<float>::quiet_NaN()) == colorOf(map, 0));
  }
}
