// SPDX-License-Identifier: Apache-2.0
// Where pictures lie in the window.
#include "viewer/window/graphics.h"

#include <memory>
#include <vector>

#include "support/catch.h"

using namespace tg;

namespace {

struct NoImage : PictureImage {
  explicit NoImage(glm::ivec2 s) : PictureImage(s) {}
};

Picture pictureOf(glm::ivec2 size) {
  Picture picture;
  picture.image = std::make_shared<NoImage>(size);
  picture.other = std::make_shared<NoImage>(size);
  return picture;
}

}  // namespace

TEST_CASE("a picture of a mode before keeps its shape until the next one comes") {
  const PixelRect area{{100, 0}, {800, 600}};
  // From side to wipe: half as wide as its place.
  for (const PictureBlit& blit : layOut(pictureOf({400, 600}), {.mode = CompareMode::wipe}, area)) {
    CHECK(blit.to.size == glm::ivec2(200, 600));
    CHECK(blit.from.size == glm::ivec2(200, 600));
  }
  const auto whole = layOut(pictureOf({400, 600}), {.mode = CompareMode::off}, area);
  REQUIRE(whole.size() == 1);
  CHECK(whole[0].to.origin == glm::ivec2(300, 0));
  CHECK(whole[0].to.size == glm::ivec2(400, 600));
  // And back: twice as wide.
  const auto side = layOut(pictureOf({800, 600}), {.mode = CompareMode::side}, area);
  REQUIRE(side.size() == 2);
  for (const PictureBlit& blit : side) CHECK(blit.to.size == glm::ivec2(400, 300));
  CHECK(side[1].to.origin == glm::ivec2(500, 150));
}

TEST_CASE("a picture of any resolution fills its place to the last pixel") {
  for (const glm::ivec2 size : {glm::ivec2(801, 597), glm::ivec2(1920, 31), glm::ivec2(3, 1200)}) {
    const PixelRect area{{7, 5}, size};
    for (const double scale : {2.0, 1.0, 0.77, 0.25, 0.1, 0.025}) {
      const glm::ivec2 drawn = glm::max(glm::ivec2(glm::dvec2(size) * scale), glm::ivec2(1));
      const auto blits = layOut(pictureOf(drawn), {.mode = CompareMode::off}, area);
      REQUIRE(blits.size() == 1);
      CHECK(blits[0].to.origin == area.origin);
      CHECK(blits[0].to.size == area.size);
      CHECK(blits[0].from.size == drawn);
    }
  }
}
