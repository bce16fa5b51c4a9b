// SPDX-License-Identifier: Apache-2.0
// Cameras: OpenCV axes, and views of another size.
#include "core/model/camera.h"

#include <cmath>

#include "support/catch.h"

namespace {

void requireNear(const glm::dvec3& found, const glm::dvec3& expected) {
  for (int i = 0; i < 3; ++i) REQUIRE(found[i] == Approx(expected[i]).margin(1e-12));
}

}  // namespace

TEST_CASE("a camera that looks at a target has it in the centre, with up towards smaller y") {
  const tg::Camera camera = tg::lookAt({1, 2, -5}, {1, 2, 3}, {0, -1, 0}, M_PI / 2, 200, 100);
  requireNear(camera.position(), {1, 2, -5});
  requireNear(cameraFromWorld(camera, {1, 2, 3}), {0, 0, 8});
  requireNear(cameraFromWorld(camera, {1, 1, 3}), {0, -1, 8});  // up in the world is up in the image
  requireNear(cameraFromWorld(camera, {2, 2, 3}), {1, 0, 8});
  REQUIRE(camera.focal.y == Approx(50.0));
  REQUIRE(camera.focal.x == Approx(50.0));
  REQUIRE(camera.center.x == 100.0);
  REQUIRE(glm::determinant(camera.rotation) == Approx(1.0));
}

TEST_CASE("a ray goes through the pixel that its points project to") {
  tg::Camera camera;
  camera.focal = {100, 50};
  camera.center = {30, 20};
  REQUIRE(project(camera, {1, 2, 4}) == glm::dvec2(55, 45));
  REQUIRE(ray(camera, {55, 45}) == glm::dvec3(0.25, 0.5, 1));
  REQUIRE(focalCenter(camera) == glm::vec4(100, 50, 30, 20));
}

TEST_CASE("scaling around the middle keeps the pixels' shape") {
  tg::Camera camera = tg::lookAt({0, 0, 1}, {0, 0, 0}, {0, 1, 0}, 1.0, 200, 100);
  camera.center.x = 90;
  const tg::Camera half = tg::scaled(camera, 0.5, 300, 40);
  REQUIRE(half.size == glm::ivec2(300, 40));
  REQUIRE(half.focal == camera.focal / 2.0);
  REQUIRE(half.center == glm::dvec2(145, 20));
}

TEST_CASE("looking along the up vector still gives a rotation") {
  const tg::Camera camera = tg::lookAt({0, 0, 0}, {0, 5, 0}, {0, 1, 0}, 1.0, 10, 10);
  REQUIRE(glm::determinant(camera.rotation) == Approx(1.0));
}

TEST_CASE("resizing scales the intrinsics per axis") {
  tg::Camera camera = tg::lookAt({0, 0, 1}, {0, 0, 0}, {0, 1, 0}, 1.0, 200, 100);
  camera.center.x = 90;
  const tg::Camera half = tg::resized(camera, 100, 25);
  REQUIRE(half.size.x == 100);
  REQUIRE(half.center.x == 45.0);
  REQUIRE(half.focal.x == camera.focal.x / 2);
  REQUIRE(half.focal.y == camera.focal.y / 4);
  REQUIRE(half.center.y == camera.center.y / 4);
}
