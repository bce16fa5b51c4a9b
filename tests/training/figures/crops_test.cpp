// SPDX-License-Identifier: Apache-2.0
// Which crops a report shows.
#include "training/figures/crops.h"

#include <string>

#include "core/system/error.h"
#include "support/catch.h"

using namespace tg;

namespace {

// Zeros with a square of ones.
Image errorAt(int x, int y, int side, int width = 128, int height = 96) {
  Image map(width, height, 1);
  for (int j = y; j < y + side; ++j) {
    for (int i = x; i < x + side; ++i) map.at(i, j, 0) = 1;
  }
  return map;
}

void see(CropChooser& chooser, const std::string& name, const std::vector<Image>& errors) {
  const Image photograph(errors.front().width, errors.front().height, 3, 0.25f);
  const std::vector<Image> pictures(errors.size(), Image(photograph.width, photograph.height, 3, 0.5f));
  chooser.see({name, photograph, pictures, errors});
}

}  // namespace

TEST_CASE("the box with the largest mean is found, the first among equals") {
  CHECK(largestBox(errorAt(70, 33, 10), {10, 10}) == PixelBox{{70, 33}, {10, 10}});
  CHECK(largestBox(errorAt(128 - 10, 96 - 10, 10), {10, 10}) == PixelBox{{118, 86}, {10, 10}});
  CHECK(largestBox(Image(20, 10, 1), {4, 4}) == PixelBox{{0, 0}, {4, 4}});
  CHECK(largestBox(Image(4, 4, 1, 1.0f), {4, 4}) == PixelBox{{0, 0}, {4, 4}});
}

TEST_CASE("models differ where their errors do, one model where it errs") {
  const std::vector<Image> errors = {errorAt(10, 10, 8), errorAt(10, 10, 8), errorAt(50, 10, 8)};
  CHECK(differenceMap({errors.data(), 1}).at(12, 12, 0) == 1);
  const Image equal = differenceMap({errors.data(), 2});
  CHECK(equal.at(12, 12, 0) == 0);
  const Image map = differenceMap(errors);
  CHECK(map.at(12, 12, 0) == 1);
  CHECK(map.at(52, 12, 0) == 1);
  CHECK(map.at(30, 12, 0) == 0);
}

TEST_CASE("a report shows the views where models differ most, the largest first, and no more than are wanted") {
  CropChooser chooser({}, 2);
  see(chooser, "weak", {errorAt(5, 5, 4)});
  see(chooser, "strong", {errorAt(40, 40, 24)});
  see(chooser, "middling", {errorAt(60, 8, 12)});
  const std::vector<Crop> crops = chooser.finish();
  REQUIRE(crops.size() == 2);
  CHECK(crops[0].view == "strong");
  CHECK(crops[0].box == PixelBox{{40, 40}, {24, 24}});
  CHECK(crops[0].difference == 1);
  CHECK(crops[1].view == "middling");
  CHECK(crops[1].photograph.width == 24);
  CHECK(crops[1].pictures.size() == 1);
  CHECK(crops[1].errors.front().channels == 1);
  CHECK(crops[1].overview.width == 128);
}

TEST_CASE("a crop that is asked for is of its view, or of the one where it shows most") {
  CropChooser chooser({{{{40, 40}, {8, 8}}, ""}, {{{0, 0}, {16, 8}}, "a"}}, 0);
  see(chooser, "test/a.png", {errorAt(80, 40, 8)});
  see(chooser, "test/b.png", {errorAt(40, 40, 8)});
  const std::vector<Crop> crops = chooser.finish();
  REQUIRE(crops.size() == 2);
  CHECK(crops[0].view == "test/b.png");
  CHECK(crops[1].view == "test/a.png");
  CHECK(crops[1].photograph.height == 8);
  CHECK(crops[0].asked);

  CropChooser outside({{{{100, 40}, {64, 8}}, ""}}, 0);
  see(outside, "a", {errorAt(0, 0, 8)});
  CHECK(outside.finish().empty());
  CHECK_FALSE(grants("a", {128, 96}, {{{100, 40}, {64, 8}}, ""}));
  CHECK_THROWS_WITH(refuseWish({{{100, 40}, {64, 8}}, "a"}), "--crop 100,40,64,8@a: no view holds it");
  CropChooser nobody({{{{0, 0}, {8, 8}}, "z"}}, 0);
  see(nobody, "a", {errorAt(0, 0, 8)});
  CHECK(nobody.finish().empty());
}

TEST_CASE("a crop is four numbers, and a view if wanted") {
  CHECK(parseCropWish("1,2,30,40", "--crop").box == PixelBox{{1, 2}, {30, 40}});
  CHECK(parseCropWish("1,2,30,40@r_3", "--crop").view == "r_3");
  for (const char* bad :
       {"", "1,2,3", "1,2,0,4", "-1,2,3,4", "1,2,3,4@", "1,2,3,4,5", "a,b,c,d", "1,2,3,99999999999"}) {
    CHECK_THROWS_WITH(parseCropWish(bad, "--crop"), Contains("--crop: expected x,y,w,h or x,y,w,h@VIEW"));
  }
  // Corners so far out that a sum would overflow.
  CropChooser far({{{{2147483647, 0}, {8, 8}}, ""}}, 0);
  see(far, "a", {errorAt(0, 0, 8)});
  CHECK(far.finish().empty());
}

TEST_CASE("tiny pictures have crops, too") {
  CHECK(cropSize(Image(128, 96, 1)) == glm::ivec2(24));
  CHECK(cropSize(Image(40, 20, 1)) == glm::ivec2(16));
  CHECK(cropSize(Image(3, 7, 1)) == glm::ivec2(3));
  CropChooser chooser({}, 3);
  see(chooser, "a", {Image(1, 1, 1, 0.5f)});
  CHECK(chooser.finish().size() == 1);
}
