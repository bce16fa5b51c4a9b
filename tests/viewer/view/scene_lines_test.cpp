// SPDX-License-Identifier: Apache-2.0
// Lines in the scene: where they land in the image, and when there are any.
#include "viewer/view/scene_lines.h"

#include "support/catch.h"
#include "support/scenes.h"
#include "viewer/view/path_editor.h"

using namespace tg;

TEST_CASE("a segment before the camera lands where its ends project") {
  const Camera camera = lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 200, 100);
  const auto line = projected(camera, {0, 0, 0}, {1, 0.5, 0});
  REQUIRE(line);
  CHECK(glm::length(line->first - glm::dvec2(100, 50)) < 1e-9);
  CHECK(line->second.x == Approx(100 + camera.focal.x / 4));
  CHECK(line->second.y == Approx(50 + camera.focal.y / 8));
}

TEST_CASE("a segment through the camera's plane keeps its visible part on its line, one behind is gone") {
  test::Random random(31);
  const Camera camera = lookAt({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 0.8, 200, 100);
  for (int i = 0; i < 200; ++i) {
    const glm::dvec3 before(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(1, 3));
    const glm::dvec3 behind(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-3, -0.1));
    const auto whole = projected(camera, behind, before), other = projected(camera, before, behind);
    REQUIRE(whole);
    REQUIRE(other);
    CHECK(glm::length(whole->second - other->first) < 1e-6);
    CHECK(glm::length(whole->second - projected(camera, before, before)->first) < 1e-9);
    // A point of the segment in front lies on the line between the ends.
    const glm::dvec3 middle = before + (behind - before) * 0.3 * (before.z / (before.z - behind.z));
    const glm::dvec2 m = projected(camera, middle, middle)->first;
    const glm::dvec2 along = glm::normalize(whole->second - whole->first), off = m - whole->first;
    CHECK(std::abs(along.x * off.y - along.y * off.x) < 1e-6 * (1 + glm::length(off)));
    CHECK_FALSE(projected(camera, behind, behind));
  }
}

TEST_CASE("a path is drawn with its keys, not while it plays") {
  ViewerState state;
  CHECK(sceneLines(state).empty());
  addKey(state);
  CHECK(sceneLines(state).size() == 8);  // one frustum
  orbit(state.camera.pose, 0.5, 0);
  addKey(state);
  CHECK(sceneLines(state).size() > 16);
  state.path.playing = true;
  CHECK(sceneLines(state).empty());
  state.path.playing = false;
  state.path.drawn = false;
  CHECK(sceneLines(state).empty());
}

TEST_CASE("a box has twelve edges") {
  std::vector<SceneLine> lines;
  appendBox(lines, {0, 0, 0}, {1, 2, 3}, glm::vec3(1));
  REQUIRE(lines.size() == 12);
  double sum = 0;
  for (const SceneLine& line : lines) sum += glm::length(line.b - line.a);
  CHECK(sum == Approx(4 * (1 + 2 + 3)));
}
