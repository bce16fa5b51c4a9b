// SPDX-License-Identifier: Apache-2.0
// Values of flags and script commands.
#include "viewer/view/parse.h"

#include "core/system/error.h"
#include "render/settings.h"
#include "support/catch.h"
#include "viewer/view/camera_controller.h"

using namespace tg;

TEST_CASE("sizes: both numbers, whole, in range") {
  CHECK(parseSize("640x480", "--size") == glm::ivec2(640, 480));
  for (const char* bad : {"", "x", "640", "640x", "x480", "0x5", "5x0", "-1x5", "640x480x3", "640X480", "1e3x5", " 4x4",
                          "99999x1", "16384x16384", "99999999999999x1", "4.5x4"}) {
    CHECK_THROWS_AS(parseSize(bad, "--size"), Error);
  }
}

TEST_CASE("pixels, numbers and names: a wrong one says what was expected") {
  CHECK(parsePixel("3,40", "--inspect") == glm::ivec2(3, 40));
  for (const char* bad : {"", "3", "3,", "-1,2", "1,2,3", "1.5,2"}) {
    CHECK_THROWS_AS(parsePixel(bad, "--inspect"), Error);
  }
  CHECK(parse<Output>("count", "--show") == Output::count);
  CHECK_THROWS_WITH(parse<Output>("colour", "--show"), "--show: expected " + allNames<Output>() + ", found \"colour\"");
  CHECK(allNames<Output>().starts_with("final, base, texture, "));
  CHECK(parse<UpAxis>("-y", "--up") == UpAxis::minusY);
  CHECK_THROWS_WITH(parse<UpAxis>("y", "--up"), "--up: expected cameras, +x, -x, +y, -y, +z or -z, found \"y\"");
  CHECK_THROWS_AS(parseNumber("1 2", "fov"), Error);
  CHECK_THROWS_AS(parseNumber("nan", "fov"), Error);
}

TEST_CASE("what is counted is whole, and nothing of it is cut off") {
  CHECK(parseCount("1", 1, 100, "--turntable") == 1);
  CHECK(parseCount("1e2", 1, 100, "--turntable") == 100);
  for (const char* bad : {"", "0", "101", "2.9", "0.5", "99.999", "nan", "inf", "2 ", "x"}) {
    CHECK_THROWS_WITH(parseCount(bad, 1, 100, "--turntable"),
                      "--turntable: expected a whole number from 1 to 100, found \"" + std::string(bad) + "\"");
  }
}

TEST_CASE("a number in a list is below its length and of an empty list there is none") {
  CHECK(parseIndex("1", 2, "pick") == 1);
  CHECK_THROWS_WITH(parseIndex("2", 2, "pick"), "pick: expected a number below 2, found \"2\"");
  CHECK_THROWS_WITH(parseIndex("0", 0, "pick"), "pick: expected none: there is nothing to choose from, found \"0\"");
}

TEST_CASE("a camera's number must exist") {
  const std::vector<Camera> cameras(3, lookAt({0, 0, -2}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48));
  CHECK(cameraOf("2", cameras, "--camera").size.x == 64);
  CHECK_THROWS_WITH(cameraOf("3", cameras, "--camera"), "--camera: expected 0 to 2 (see --list-cameras), found \"3\"");
  CHECK_THROWS_WITH(cameraOf("-1", cameras, "--camera"), Contains("expected 0 to 2"));
  CHECK_THROWS_AS(cameraOf("99999999999999999999", cameras, "--camera"), Error);
  CHECK_THROWS_AS(cameraOf("0", {}, "--camera"), Error);
  CHECK_THROWS_AS(cameraOf("no-such-file.json", cameras, "--camera"), Error);
}
