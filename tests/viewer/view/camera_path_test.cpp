// SPDX-License-Identifier: Apache-2.0
// Camera paths: through every key, smooth between, the same after a file.
#include "viewer/view/camera_path.h"

#include <cmath>

#include "core/bundle/camera_file.h"
#include "core/file/file.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "support/temporary_folder.h"

using namespace tg;

namespace {

CameraPath randomPath(test::Random& random, int keys, double closing) {
  CameraPath path;
  path.aspect = 4.0 / 3.0;
  for (int i = 0; i < keys; ++i) {
    const glm::dvec3 eye = random.uniformVec3(-3, 3);
    const Camera camera = lookAt(eye, eye + random.direction(), random.direction(), random.uniform(0.4, 1.5), 640, 480);
    appendKey(path, keyOf(camera, 0), random.uniform(0.2, 3.0));
  }
  path.closing = closing;
  return path;
}

// Of two rotations [rad].
double angle(const glm::dquat& a, const glm::dquat& b) {
  return 2 * std::acos(std::min(1.0, std::abs(glm::dot(a, b))));
}

void checkSame(const PathKey& a, const PathKey& b, double tolerance) {
  CHECK(glm::length(a.position - b.position) < tolerance);
  CHECK(angle(a.world_from_camera, b.world_from_camera) < std::max(tolerance, 1e-7));
  CHECK(a.lens.fov_y == Approx(b.lens.fov_y).margin(tolerance));
}

glm::dvec3 angularVelocity(const CameraPath& path, double from, double to) {
  const glm::dquat turn = at(path, to).world_from_camera * glm::conjugate(at(path, from).world_from_camera);
  const double sign = turn.w < 0 ? -1 : 1;
  return 2.0 * sign * glm::dvec3(turn.x, turn.y, turn.z) / (to - from);
}

}  // namespace

TEST_CASE("a path passes through every key at its time") {
  test::Random random(21);
  for (double closing : {0.0, 1.5}) {
    const CameraPath path = randomPath(random, 7, closing);
    for (const PathKey& key : path.keys) checkSame(at(path, key.time), key, 1e-9);
  }
}

TEST_CASE("position, rotation and focal length have one velocity on both sides of a key") {
  test::Random random(22);
  constexpr double kStep = 1e-5;
  const CameraPath path = randomPath(random, 8, 2.0);
  for (const PathKey& key : path.keys) {
    const double t = key.time == 0 ? duration(path) : key.time;  // the seam of the loop too
    const PathKey before = at(path, t - kStep), here = at(path, t), after = at(path, t + kStep);
    CHECK(glm::length((here.position - before.position) - (after.position - here.position)) / kStep < 1e-2);
    CHECK(glm::length(angularVelocity(path, t - kStep, t) - angularVelocity(path, t, t + kStep)) < 1e-2);
    CHECK(std::abs((here.lens.fov_y - before.lens.fov_y) - (after.lens.fov_y - here.lens.fov_y)) / kStep < 1e-2);
  }
}

TEST_CASE("two keys: steady motion, and a zoom of equal factors in equal times") {
  CameraPath path;
  appendKey(path, keyOf(lookAt({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 0.4, 100, 100), 0), 1);
  appendKey(path, keyOf(lookAt({4, 0, 0}, {4, 1, 0}, {0, 0, 1}, 1.6, 100, 100), 0), 4);
  const PathKey quarter = at(path, 1), half = at(path, 2);
  CHECK(glm::length(quarter.position - glm::dvec3(1, 0, 0)) < 1e-9);
  CHECK(angle(quarter.world_from_camera, path.keys[0].world_from_camera) ==
        Approx(angle(path.keys[1].world_from_camera, path.keys[0].world_from_camera) / 4));
  CHECK(std::tan(half.lens.fov_y / 2) == Approx(std::sqrt(std::tan(0.2) * std::tan(0.8))));
}

TEST_CASE("a key that repeats its neighbour stands still, and nothing overshoots a stop") {
  CameraPath path;
  for (double x : {0.0, 1.0, 1.0, 1.0, 5.0}) {
    appendKey(path, keyOf(lookAt({x, 0, -3}, {x, 0, 0}, {0, -1, 0}, 0.8, 64, 64), 0), 1);
  }
  for (double t = 1; t <= 3; t += 0.05) CHECK(at(path, t).position.x == Approx(1.0));
  for (double t = 0; t <= 4; t += 0.01) {
    CHECK(at(path, t).position.x >= -1e-12);
    CHECK(at(path, t).position.x <= 5 + 1e-12);
  }
}

TEST_CASE("an open path stands still beyond its ends, a closed one goes round") {
  test::Random random(23);
  CameraPath path = randomPath(random, 4, 0);
  checkSame(at(path, -5), path.keys.front(), 1e-12);
  checkSame(at(path, 1e6), path.keys.back(), 1e-12);
  path.closing = 0.75;
  checkSame(at(path, duration(path)), path.keys.front(), 1e-9);
  checkSame(at(path, -0.2), at(path, duration(path) - 0.2), 1e-9);
  checkSame(at(path, 0.3), at(path, 3 * duration(path) + 0.3), 1e-6);
  path.keys.resize(1);
  path.closing = 0;
  checkSame(at(path, 3), path.keys.front(), 0 + 1e-12);
}

TEST_CASE("rotations take the shorter way round whatever their quaternions' signs") {
  CameraPath path;
  for (double turn : {0.0, 0.5, 1.0, 1.5}) {
    PathKey key;
    key.world_from_camera = glm::angleAxis(turn, glm::dvec3(0, 1, 0));
    if (path.keys.size() % 2 == 1) key.world_from_camera = -key.world_from_camera;
    appendKey(path, key, 1);
  }
  for (double t = 0; t <= 3; t += 0.1) {
    CHECK(angle(at(path, t).world_from_camera, path.keys[0].world_from_camera) == Approx(0.5 * t).margin(1e-6));
  }
}

TEST_CASE("frames: both ends of an open path, a closed one without its first picture again") {
  test::Random random(24);
  CameraPath path = randomPath(random, 2, 0);
  path.keys[1].time = 2;
  CHECK(pathCameras(path, 30, 64, 48).size() == 61);
  CHECK(glm::length(pathCameras(path, 30, 64, 48).back().position() - path.keys[1].position) < 1e-6);
  path.closing = 1;
  CHECK(pathCameras(path, 30, 64, 48).size() == 90);
  path.keys.resize(1);
  path.closing = 0;
  CHECK(pathCameras(path, 30, 64, 48).size() == 1);
  path.closing = kMaxPathSeconds;
  CHECK_THROWS_AS(pathCameras(path, 30, 64, 48), Error);
}

TEST_CASE("a key is its camera, at its size and at others as --size fits it") {
  const Camera camera = lookAt({1, 2, -3}, {0, 0, 0.5}, {0, -1, 0.1}, 0.7, 640, 480);
  Camera odd = camera;
  odd.center.x += 12;
  odd.center.y -= 7;
  odd.focal.x *= 1.05;
  for (const glm::ivec2 size : {glm::ivec2(640, 480), glm::ivec2(1280, 480), glm::ivec2(300, 700)}) {
    const Camera back = toCamera(keyOf(odd, 0), 640.0 / 480.0, size.x, size.y);
    const Camera expected = fitted(odd, size.x, size.y);
    CHECK(back.focal.x == Approx(expected.focal.x));
    CHECK(back.focal.y == Approx(expected.focal.y));
    CHECK(back.center.x == Approx(expected.center.x));
    CHECK(back.center.y == Approx(expected.center.y));
    CHECK(glm::length(back.position() - expected.position()) < 1e-9);
  }
}

TEST_CASE("a turntable goes once round the pivot, level, and starts with its start") {
  const ViewPose start = levelPose({0, 0, 1}, {3, 1, 1}, {0.5, 0.5, 0});
  const Lens lens;
  const std::vector<Camera> cameras = turntableCameras(start, lens, 8, 64, 48);
  REQUIRE(cameras.size() == 8);
  CHECK(glm::length(cameras[0].position() - start.position) < 1e-12);
  glm::dvec3 sum(0.0);
  for (const Camera& camera : cameras) {
    CHECK(glm::length(camera.position() - start.pivot()) == Approx(start.distance));
    CHECK(camera.position().z == Approx(start.position.z));
    sum += camera.position();
  }
  CHECK(glm::length(sum / 8.0 - glm::dvec3(0.5, 0.5, 1)) < 1e-9);
  // Counter-clockwise around up.
  const glm::dvec3 first = cameras[0].position() - start.pivot(), second = cameras[1].position() - start.pivot();
  CHECK(glm::cross(first, second).z > 0);
}

TEST_CASE("a path comes back from its file to the last bit, and from cameras.json as its keys") {
  test::Random random(25);
  const TemporaryFolder folder;
  for (double closing : {0.0, 2.5}) {
    CameraPath path = randomPath(random, 5, closing);
    path.keys[2].lens.shift = {0.1, -0.05};
    path.keys[2].lens.pixel_aspect = 1.02;
    const std::string text = formatPath(path);
    writeFileAtomically(folder / "p.json", std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
    const CameraPath back = readPath(folder / "p.json");
    REQUIRE(back.keys.size() == path.keys.size());
    CHECK(back.closing == path.closing);
    CHECK(back.aspect == path.aspect);
    for (std::size_t i = 0; i < path.keys.size(); ++i) {
      CHECK(back.keys[i].time == path.keys[i].time);
      CHECK(back.keys[i].position == path.keys[i].position);
      CHECK(back.keys[i].lens.pixel_aspect == path.keys[i].lens.pixel_aspect);
      CHECK(back.keys[i].lens.shift == path.keys[i].lens.shift);
      checkSame(back.keys[i], path.keys[i], 1e-12);
    }
    const CameraPath cameras = parsePath(formatCameras(keyCameras(path, 480)), "cameras.json");
    REQUIRE(cameras.keys.size() == path.keys.size());
    CHECK(cameras.aspect == Approx(path.aspect));
    for (std::size_t i = 0; i < path.keys.size(); ++i) {
      CHECK(cameras.keys[i].time == static_cast<double>(i));
      checkSame(cameras.keys[i], path.keys[i], 1e-6);
    }
  }
}

TEST_CASE("a broken path names key and member") {
  const auto path = [](const std::string& keys, const std::string& rest = "") {
    return R"({"format":"tgview-path","version":1,"aspect":1.5,)" + rest + R"("keys":[)" + keys + "]}";
  };
  const std::string good = R"({"time":0,"position":[0,0,0],"rotation":[1,0,0,0],"fov_y":40})";
  CHECK(parsePath(path(good), "p.json").keys.size() == 1);
  struct Case {
    std::string json, message;
  };
  const std::vector<Case> cases = {
      {"{", "p.json: not valid JSON"},
      {"3", "p.json: expected a camera path, found number"},
      {"[]", "p.json: no camera inside (expected at least 1, found 0)"},
      {"{}", "missing key \"format\""},
      {R"({"format":"other"})", "\"format\": expected \"tgview-path\""},
      {R"({"format":"tgview-path","version":2})", "\"version\": expected 1, found 2"},
      {path(""), "\"keys\": expected an array of 1 to 10000 keys"},
      {path(good + "," + good), "key 1: \"time\": expected at least 1 ms after the key before it"},
      {path(good, R"("closing":-1,)"), "\"closing\": expected 0 to 86400, found -1"},
      {path(good, R"("closing":1e-9,)"), "\"closing\": expected 0 or at least 1 ms"},
      {path(R"({"time":0,"position":[0,0],"rotation":[1,0,0,0],"fov_y":40})"),
       "key 0: \"position\": expected an array"},
      {path(R"({"time":0,"position":[0,0,1e30],"rotation":[1,0,0,0],"fov_y":40})"),
       "key 0: \"position\": expected -1e"},
      {path(R"({"time":0,"position":[0,0,0],"rotation":[1,1,0,0],"fov_y":40})"), "quaternion of length 1"},
      {path(R"({"time":0,"position":[0,0,0],"rotation":[0,0,0,0],"fov_y":40})"), "quaternion of length 1"},
      {path(R"({"time":0,"position":[0,0,0],"rotation":[1,0,0,0],"fov_y":180})"), "key 0: \"fov_y\": expected"},
      {path(R"({"time":-1,"position":[0,0,0],"rotation":[1,0,0,0],"fov_y":40})"), "key 0: \"time\": expected"},
  };
  for (const Case& broken : cases) {
    INFO(broken.json);
    CHECK_THROWS_WITH(parsePath(broken.json, "p.json"), Contains(broken.message));
  }
  CHECK_THROWS_AS(readPath("no-such-path.json"), Error);
}

TEST_CASE("edits keep the order of the keys and the first at 0") {
  test::Random random(26);
  CameraPath path = randomPath(random, 4, 0);
  const double last = keySeconds(path, 2);
  setKeySeconds(path, 1, 5);
  CHECK(keySeconds(path, 1) == Approx(5));
  CHECK(keySeconds(path, 2) == Approx(last));
  setKeySeconds(path, 0, -3);
  CHECK(keySeconds(path, 0) == Approx(kLeastKeySeconds));
  removeKey(path, 0);
  CHECK(path.keys.front().time == 0);
  CHECK(keySeconds(path, 0) == Approx(5));
  setKeySeconds(path, 2, 1.5);
  CHECK(path.closing == 1.5);
  setKeySeconds(path, 2, 0);
  CHECK(path.closing == 0);
  CHECK(keySeconds(path, 2) == 0);
}

TEST_CASE("a path stays as short as its file may be") {
  test::Random random(27);
  CameraPath path = randomPath(random, 3, 0);
  setKeySeconds(path, 0, 1e9);
  CHECK(path.keys.back().time == Approx(kMaxPathSeconds));
  CHECK_THROWS_WITH(appendKey(path, path.keys.back(), 1), Contains("too long"));
  CHECK(parsePath(formatPath(path), "p").keys.size() == 3);
}
