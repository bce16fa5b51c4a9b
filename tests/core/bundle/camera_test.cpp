// SPDX-License-Identifier: Apache-2.0
// cameras.json: exact round trips, and refusal of broken files.
#include <cmath>

#include "core/bundle/camera_file.h"
#include "core/model/camera.h"
#include "core/system/error.h"
#include "support/catch.h"

namespace {

const std::string kInria =
    "[{\"id\": 0, \"img_name\": \"00001\", \"width\": 640, \"height\": 480, \"position\": [1.0, 2.0, 3.0],"
    " \"rotation\": [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], \"fx\": 500.0, \"fy\": 510.0}]";

std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != text.npos);
  return text.replace(at, from.size(), to);
}

void requireNear(const glm::dvec3& found, const glm::dvec3& expected) {
  for (int i = 0; i < 3; ++i) REQUIRE(found[i] == Approx(expected[i]).margin(1e-12));
}

}  // namespace

TEST_CASE("INRIA's cameras.json is read: position in the world, rotation by rows of world from camera") {
  const std::vector<tg::Camera> cameras = tg::parseCameras(kInria, "c.json");
  REQUIRE(cameras.size() == 1);
  REQUIRE(cameras[0].name == "00001");
  REQUIRE(cameras[0].center.x == 320.0);
  REQUIRE(cameras[0].center.y == 240.0);
  REQUIRE_FALSE(cameras[0].test);
  requireNear(cameras[0].position(), {1, 2, 3});
  // Camera x in the world is the first column of the rows above.
  requireNear(glm::transpose(cameras[0].rotation) * glm::dvec3(1, 0, 0), {0, 1, 0});
}

TEST_CASE("cameras survive their file exactly and give the same text again") {
  std::vector<tg::Camera> cameras;
  for (int i = 0; i < 20; ++i) {
    cameras.push_back(tg::lookAt({std::sin(i * 1.7), 0.1 * i, std::cos(i * 1.7)}, {0.1, 0.2, 0.3}, {0, -1, 0},
                                 0.3 + 0.1 * i, 640, 480));
    cameras.back().name = "im\xc3\xa4ge \"" + std::to_string(i) + "\"";
    cameras.back().test = i % 8 == 0;
    cameras.back().center.x = 1.0 / 3.0 + i;
  }
  const std::string text = tg::formatCameras(cameras);
  const std::vector<tg::Camera> back = tg::parseCameras(text, "c.json");
  REQUIRE(tg::formatCameras(back) == text);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    REQUIRE(back[i].rotation == cameras[i].rotation);
    REQUIRE(back[i].translation == cameras[i].translation);
    REQUIRE(back[i].name == cameras[i].name);
    REQUIRE(back[i].center.x == cameras[i].center.x);
    REQUIRE(back[i].test == cameras[i].test);
  }
  REQUIRE(tg::parseCameras(tg::formatCameras({}), "c.json").empty());
}

TEST_CASE("a rotation of three digits becomes one, so that eye and depths agree") {
  const std::string rounded = with(kInria, "[0.0, -1.0, 0.0]", "[0.0003, -1.0, 0.0]");
  const tg::Camera camera = tg::parseCameras(rounded, "c.json")[0];
  const glm::dmat3 gram = glm::transpose(camera.rotation) * camera.rotation;
  for (int k = 0; k < 9; ++k) CHECK(gram[k / 3][k % 3] == Approx(k / 3 == k % 3 ? 1.0 : 0.0).margin(1e-12));
  const glm::dvec3 eye = camera.position();
  for (int k = 0; k < 3; ++k) CHECK(eye[k] == Approx(1.0 + k).margin(1e-12));
  // Its exact translation is compared by the rotation that stands beside it.
  tg::Camera skewed = tg::lookAt({60, 70, 80}, {0, 0, 0}, {0, 1, 0}, 1.0, 4, 4);
  skewed.rotation[0] += 9e-4 * skewed.rotation[1];
  CHECK_NOTHROW(tg::parseCameras(tg::formatCameras({skewed}), "c.json"));
}

TEST_CASE("cameras of pictures as wide as data sets may have are read again") {
  tg::Camera camera = tg::lookAt({0, 0, 1}, {0, 0, 0}, {0, 1, 0}, 1.0, 1 << 20, 4);
  CHECK(tg::parseCameras(tg::formatCameras({camera}), "c.json")[0].size.x == 1 << 20);
}

TEST_CASE("image names of another encoding do not break the file") {
  tg::Camera camera = tg::lookAt({0, 0, 1}, {0, 0, 0}, {0, 1, 0}, 1.0, 4, 4);
  camera.name = "\xff.png";
  REQUIRE(tg::parseCameras(tg::formatCameras({camera}), "c.json")[0].name == "\xef\xbf\xbd.png");
}

TEST_CASE("broken cameras are refused with index and key") {
  const auto parse = [](const std::string& text) { return tg::parseCameras(text, "c.json"); };
  REQUIRE_THROWS_WITH(parse("{}"), Contains("c.json: expected an array of cameras, found object"));
  REQUIRE_THROWS_WITH(parse("[3]"), Contains("c.json: camera 0: expected an object, found number"));
  REQUIRE_THROWS_WITH(parse(with(kInria, "\"fx\"", "\"fX\"")), Contains("camera 0: missing key \"fx\""));
  REQUIRE_THROWS_WITH(parse(with(kInria, "500.0", "-1")), Contains("above 0"));
  REQUIRE_THROWS_WITH(parse(with(kInria, "500.0", "\"a\"")), Contains("\"fx\": expected a number, found string"));
  REQUIRE_THROWS_WITH(parse(with(kInria, "640", "0")),
                      Contains("\"width\": expected an integer from 1 to 1048576, found 0"));
  REQUIRE_THROWS_WITH(parse(with(kInria, "640", "1e9")), Contains("\"width\""));
  REQUIRE_THROWS_WITH(parse(with(kInria, "[1.0, 2.0, 3.0]", "[1.0, 2.0]")),
                      Contains("\"position\": expected an array of 3"));
  REQUIRE_THROWS_WITH(parse(with(kInria, "[1.0, 2.0, 3.0]", "[1, 2, 1e400]")), Contains("not valid JSON"));
  REQUIRE_THROWS_WITH(parse(with(kInria, "[0.0, -1.0, 0.0]", "[0.0, -2.0, 0.0]")), Contains("not orthonormal"));
  REQUIRE_THROWS_WITH(parse(with(kInria, "[0.0, -1.0, 0.0]", "[0.0, 1.0, 0.0]")), Contains("reflection"));
  REQUIRE_THROWS_WITH(parse(with(kInria, "[0.0, -1.0, 0.0]", "7")), Contains("3 rows of 3 numbers"));
  REQUIRE_THROWS_WITH(parse(with(kInria, "\"fx\"", "\"split\": \"val\", \"fx\"")),
                      Contains("\"split\": expected \"train\" or \"test\""));
  REQUIRE_THROWS_WITH(parse(with(kInria, "\"fx\"", "\"translation\": [9, 9, 9], \"fx\"")), Contains("disagree"));
  REQUIRE_THROWS_AS(parse(with(kInria, "\"00001\"", "7")), tg::Error);
  REQUIRE_THROWS_WITH(parse(std::string(70, '[') + std::string(70, ']')), Contains("nests too deep"));
  REQUIRE_NOTHROW(parse(with(kInria, "\"fx\"", "\"unknown\": {}, \"fx\"")));
}
