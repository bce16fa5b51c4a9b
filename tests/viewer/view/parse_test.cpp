// SPDX-License-Identifier: Apache-2.0
// Values of flags and script commands.
#include "viewer/view/parse.h"

#include "core/system/error.h"
#include "support/catch.h"

using namespace tg;

TEST_CASE("sizes: both numbers, whole, in range") {
  CHECK(parseSize("640x480", "--size") == glm::ivec2(640, 480));
  for (const char* bad : {"", "x", "640", "640x", "x480", "0x5", "5x0", "-1x5", "640x480x3", "640X480", "1e3x5", " 4x4",
                          "99999x1", "16384x16384", "99999999999999x1", "4.5x4"}) {
    CHECK_THROWS_AS(parseSize(bad, "--size"), Error);
  }
}

TEST_CASE("colours: three numbers in [0,1] or a name") {
  CHECK(parseColor("white", "--background") == glm::vec3(1));
  CHECK(parseColor("black", "--background") == glm::vec3(0));
  CHECK(parseColor("0.25,0.5,1", "--background") == glm::vec3(0.25f, 0.5f, 1));
  for (const char* bad : {"", "red", "1", "1,1", "1,1,", ",,", "1,1,1,1", "2,0,0", "-0.1,0,0", "nan,0,0", "inf,0,0"}) {
    CHECK_THROWS_AS(parseColor(bad, "--background"), Error);
  }
}

TEST_CASE("names: a wrong one says what was expected") {
  CHECK(parseTextures("off", "--textures") == TextureMode::none);
  CHECK(parseTextures("rgb", "--textures") == TextureMode::rgb);
  CHECK(parseIntersection("plane", "--intersection") == IntersectionModel::plane);
  CHECK(parseShow("count", "--show") == Output::count);
  CHECK_THROWS_WITH(parseShow("colour", "--show"),
                    "--show: expected final, base, texture, alpha, depth, normal, count, depth-median, overdraw, "
                    "ellipsoids, centers or texel-density, found \"colour\"");
  CHECK_THROWS_AS(parseTextures("on", "--textures"), Error);
  CHECK_THROWS_AS(parseNumber("1 2", "fov"), Error);
  CHECK_THROWS_AS(parseNumber("nan", "fov"), Error);
}

TEST_CASE("settings: names, ranges and boxes") {
  CHECK(parseOrder("per-pixel", "--sort") == SplatOrder::perPixel);
  CHECK(parseFilter("footprint", "--texture-filter") == TextureFilter::footprint);
  CHECK(parseAntialias("screen", "--antialiasing") == Antialiasing::screen);
  CHECK(parseUp("-y", "--up") == UpAxis::minusY);
  CHECK(parseDegree("2", "--sh-degree") == 2);
  CHECK(parsePixel("3,40", "--inspect") == glm::ivec2(3, 40));
  const CropBox box = parseCrop("1,-2,3,0.5,2,-3", "--crop");
  CHECK(box.min == glm::vec3(0.5f, -2, -3));
  CHECK(box.max == glm::vec3(1, 2, 3));
  CHECK_THROWS_WITH(parseOrder("pixel", "--sort"), "--sort: expected global or per-pixel, found \"pixel\"");
  CHECK_THROWS_AS(parseFilter("nearest", "--texture-filter"), Error);
  CHECK_THROWS_AS(parseAntialias("on", "--antialiasing"), Error);
  for (const char* bad : {"", "1,2,3", "1,2,3,4,5,", "1,2,3,4,5,x", "1,2,3,4,5,6,7", "1,2,3,4,5,inf"})
    CHECK_THROWS_AS(parseCrop(bad, "--crop"), Error);
  for (const char* bad : {"4", "-1", "1.5", ""}) CHECK_THROWS_AS(parseDegree(bad, "--sh-degree"), Error);
  for (const char* bad : {"", "3", "3,", "-1,2", "1,2,3", "1.5,2"})
    CHECK_THROWS_AS(parsePixel(bad, "--inspect"), Error);
  CHECK_THROWS_AS(parseSplatScale("0", "--splat-scale"), Error);
  CHECK_THROWS_AS(parseScale("-1", "--opacity-scale"), Error);
  CHECK_THROWS_AS(parseNear("0", "--near"), Error);
  CHECK_THROWS_AS(parseExposure("11", "--exposure"), Error);
}

TEST_CASE("a camera's number must exist") {
  const std::vector<Camera> cameras(3, lookAt({0, 0, -2}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48));
  CHECK(cameraOf("2", cameras, "--camera").size.x == 64);
  CHECK_THROWS_WITH(cameraOf("3", cameras, "--camera"), "--camera: expected 0 to 2 (see --list-cameras), found \"3\"");
  CHECK_THROWS_AS(cameraOf("99999999999999999999", cameras, "--camera"), Error);
  CHECK_THROWS_AS(cameraOf("0", {}, "--camera"), Error);
  CHECK_THROWS_AS(cameraOf("no-such-file.json", cameras, "--camera"), Error);
}
