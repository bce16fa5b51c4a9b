// SPDX-License-Identifier: Apache-2.0
// Properties of the viewer's camera.
#include "viewer/view/camera_controller.h"

#include <cmath>
#include <limits>

#include "shared/limits.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;

namespace {

double distance(const glm::dmat3& a, const glm::dmat3& b) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) sum += glm::length(a[c] - b[c]);
  return sum;
}

glm::dvec2 placeOf(const Camera& camera, glm::dvec3 point) {
  return tg::project(camera, cameraFromWorld(camera, point));
}

Camera randomCamera(test::Random& random) {
  const glm::dvec3 eye = random.uniformVec3(-3, 3);
  Camera camera = lookAt(eye, eye + random.direction(), random.direction(), random.uniform(0.4, 1.5), 640, 480);
  camera.center.x += random.uniform(-40, 40);
  camera.center.y += random.uniform(-40, 40);
  camera.focal.x *= random.uniform(0.9, 1.1);
  return camera;
}

void checkRotation(const glm::dmat3& rotation) {
  CHECK(distance(rotation * glm::transpose(rotation), glm::dmat3(1.0)) < 1e-12);
  CHECK(glm::determinant(rotation) == Approx(1.0));
}

}  // namespace

TEST_CASE("a model's camera comes back from its pose and lens") {
  test::Random random(1);
  const SceneBounds bounds{{0.3, -0.2, 0.1}, 2.0};
  for (int i = 0; i < 200; ++i) {
    const Camera camera = randomCamera(random);
    const glm::dvec3 up = random.direction();
    const ViewPose pose = poseOf(camera, up, bounds);
    const Camera back = toCamera(pose, lensOf(camera, 640.0 / 480.0), 640, 480);
    CHECK(distance(back.rotation, camera.rotation) < 1e-9);
    CHECK(glm::length(back.position() - camera.position()) < 1e-9);
    CHECK(back.focal.x == Approx(camera.focal.x));
    CHECK(back.focal.y == Approx(camera.focal.y));
    CHECK(back.center.x == Approx(camera.center.x));
    CHECK(back.center.y == Approx(camera.center.y));
  }
}

TEST_CASE("absurd focal lengths of a file become a lens that draws") {
  Camera camera = lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48);
  for (const glm::dvec2 focal : {glm::dvec2(1e-300, 1e300), glm::dvec2(1e300, 1e-300), glm::dvec2(1e-300)}) {
    camera.focal = focal;
    camera.center = {0, 1e300};
    const Lens lens = lensOf(camera, 1.5);
    CHECK(lens.pixel_aspect > 0);
    const Camera seen = toCamera({}, lens, 64, 48);
    for (int k = 0; k < 2; ++k) CHECK((std::isfinite(seen.focal[k]) && std::isfinite(seen.center[k])));
  }
}

TEST_CASE("a camera that looks straight along the up axis keeps its orientation") {
  for (const glm::dvec3 direction : {glm::dvec3(0, 1, 0), glm::dvec3(0, -1, 0)}) {
    for (const glm::dvec3 image_up : {glm::dvec3(1, 0, 0), glm::dvec3(0.6, 0, -0.8)}) {
      const Camera camera = lookAt({0, 0, 0}, direction, image_up, 0.8, 100, 100);
      const ViewPose pose = poseOf(camera, {0, -1, 0}, {});
      CHECK(distance(pose.cameraFromWorldRotation(), camera.rotation) < 1e-9);
    }
  }
}

TEST_CASE("orbiting keeps the pivot, its distance and the horizon") {
  test::Random random(2);
  ViewPose pose = levelPose({0, 0, 1}, {3, 1, 1}, {0.5, 0.5, 0});
  const glm::dvec3 pivot = pose.pivot();
  const double radius = pose.distance;
  for (int i = 0; i < 500; ++i) {
    orbit(pose, random.uniform(-2, 2), random.uniform(-2, 2));
    REQUIRE(glm::length(pose.pivot() - pivot) < 1e-9);
    REQUIRE(glm::length(pose.position - pivot) == Approx(radius));
    const glm::dmat3 rotation = pose.cameraFromWorldRotation();
    const glm::dvec3 right = glm::transpose(rotation)[0];
    REQUIRE(std::abs(glm::dot(right, pose.up())) < 1e-12);
    REQUIRE(glm::dot(glm::transpose(rotation)[1], pose.up()) < 0);  // never upside down
  }
  checkRotation(pose.cameraFromWorldRotation());
}

TEST_CASE("orbiting left and right: the scene follows the pointer") {
  ViewPose pose = levelPose({0, 0, 1}, {0, -5, 0}, {0, 0, 0});  // looks north
  const Lens lens;
  const glm::dvec3 near_point(0, -1, 0);
  const double before = placeOf(toCamera(pose, lens, 400, 400), near_point).x;
  orbit(pose, -0.1, 0);  // what a drag to the right asks for
  CHECK(placeOf(toCamera(pose, lens, 400, 400), near_point).x > before);
}

TEST_CASE("a pitch beyond the limit, from a model's camera, is left only towards the horizon") {
  const Camera camera = lookAt({0, 0, 5}, {0, 0, 0}, {0, 1, 0}, 0.8, 100, 100);
  ViewPose pose = poseOf(camera, {0, 0, 1}, {});
  const double start = pose.pitch;
  orbit(pose, 0, -0.5);
  CHECK(pose.pitch == start);
  orbit(pose, 0, 0.5);
  CHECK(pose.pitch == Approx(start + 0.5));
}

TEST_CASE("looking around keeps the position, flying keeps the orientation") {
  ViewPose pose = levelPose({0, -1, 0}, {1, 2, 3}, {0, 0, 0});
  const glm::dvec3 position = pose.position;
  look(pose, 0.7, -0.3);
  CHECK(pose.position == position);
  const glm::dmat3 rotation = pose.cameraFromWorldRotation();
  fly(pose, {0.5, -0.25, 2});
  CHECK(pose.cameraFromWorldRotation() == rotation);
  CHECK(glm::length(rotation * (pose.position - position) - glm::dvec3(0.5, -0.25, 2)) < 1e-12);
}

TEST_CASE("panning moves the pivot's plane by what it says") {
  ViewPose pose = levelPose({0, -1, 0}, {0, 0, -4}, {0, 0, 0});
  const Lens lens;
  const Camera before = toCamera(pose, lens, 300, 200);
  const glm::dvec3 pivot = pose.pivot();
  const double units_per_pixel = 2 * pose.distance * std::tan(lens.fov_y / 2) / 200;
  pan(pose, -30 * units_per_pixel, -10 * units_per_pixel);
  const glm::dvec2 moved = placeOf(toCamera(pose, lens, 300, 200), pivot) - placeOf(before, pivot);
  CHECK(moved.x == Approx(30));
  CHECK(moved.y == Approx(10));
}

TEST_CASE("dolly keeps the pivot and never reaches it") {
  ViewPose pose = levelPose({0, -1, 0}, {0, 0, -4}, {0, 0, 0});
  const glm::dvec3 pivot = pose.pivot();
  dolly(pose, 0.5);
  CHECK(glm::length(pose.position - pivot) == Approx(2));
  for (int i = 0; i < 200; ++i) dolly(pose, 0.5);
  CHECK(pose.distance > 0);
  CHECK(glm::length(pose.pivot() - pivot) < 1e-9);
  for (int i = 0; i < 400; ++i) dolly(pose, 4.0);
  CHECK(std::isfinite(pose.position.z));
}

TEST_CASE("framing puts the whole sphere into the image, in wide and tall windows") {
  test::Random random(3);
  for (const glm::ivec2 size : {glm::ivec2(1280, 720), glm::ivec2(360, 640), glm::ivec2(100, 100)}) {
    const SceneBounds bounds{random.uniformVec3(-5, 5), random.uniform(0.5, 20)};
    const Lens lens;
    ViewPose pose = levelPose({0, 0, 1}, random.uniformVec3(-9, 9), {0, 0, 0});
    const glm::dvec3 forward = pose.forward();
    frame(pose, lens, static_cast<double>(size.x) / size.y, bounds, kNear);
    CHECK(glm::length(pose.forward() - forward) < 1e-12);
    const Camera camera = toCamera(pose, lens, size.x, size.y);
    for (int i = 0; i < 200; ++i) {
      const glm::dvec2 p = placeOf(camera, bounds.center + bounds.radius * random.direction());
      CHECK(p.x > -1e-6);
      CHECK(p.x < size.x + 1e-6);
      CHECK(p.y > -1e-6);
      CHECK(p.y < size.y + 1e-6);
    }
  }
}

TEST_CASE("framing keeps a tiny model behind the near plane and no farther") {
  const SceneBounds bounds{{1, 1, 1}, 0.005};
  ViewPose pose = levelPose({0, 0, 1}, {0, 0, 0}, {1, 0, 0});
  frame(pose, {}, 1.0, bounds, kNear);
  CHECK(pose.distance - bounds.radius > kNear);
  const Lens lens;
  const double whole = bounds.radius / std::sin(0.5 * lens.fov_y);
  frame(pose, lens, 1.0, bounds, 1e-4);
  CHECK(pose.distance == Approx(whole));
  CHECK(startPose({0, 0, 1}, bounds, lens, 1.0, 1e-4).distance == Approx(whole));
}

TEST_CASE("another image size shows the whole old image, undistorted") {
  test::Random random(4);
  for (const glm::ivec2 size : {glm::ivec2(1000, 480), glm::ivec2(300, 700), glm::ivec2(1280, 960)}) {
    const Camera camera = randomCamera(random);
    const Camera other = fitted(camera, size.x, size.y);
    CHECK(other.focal.x / other.focal.y == Approx(camera.focal.x / camera.focal.y));
    for (const glm::dvec2 corner : {glm::dvec2(0, 0), glm::dvec2(640, 0), glm::dvec2(0, 480), glm::dvec2(640, 480)}) {
      const glm::dvec2 p = tg::project(other, ray(camera, corner));
      CHECK(p.x > -1e-6);
      CHECK(p.x < size.x + 1e-6);
      CHECK(p.y > -1e-6);
      CHECK(p.y < size.y + 1e-6);
    }
    // The window's way and the command line's way are one view.
    const Camera window =
        toCamera(poseOf(camera, {0, -1, 0}, {}), lensOf(camera, static_cast<double>(size.x) / size.y), size.x, size.y);
    CHECK(window.focal.x == Approx(other.focal.x));
    CHECK(window.focal.y == Approx(other.focal.y));
    CHECK(window.center.x == Approx(other.center.x));
    CHECK(window.center.y == Approx(other.center.y));
  }
}

TEST_CASE("a lens for another shape of the picture keeps what was framed as large as fits") {
  const Lens lens{.fov_y = 0.7, .pixel_aspect = 1.3, .shift = {0.1, -0.2}};
  for (const glm::ivec2 from : {glm::ivec2(800, 600), glm::ivec2(500, 1000), glm::ivec2(400, 400)}) {
    for (const glm::ivec2 to : {glm::ivec2(1000, 400), glm::ivec2(300, 700), glm::ivec2(640, 640)}) {
      const auto aspect = [](glm::ivec2 size) { return static_cast<double>(size.x) / size.y; };
      const Lens other = reshaped(lens, aspect(from), aspect(to));
      const Camera before = toCamera({}, lens, from.x, from.y), after = toCamera({}, other, to.x, to.y);
      const double scale = static_cast<double>(std::min(to.x, to.y)) / std::min(from.x, from.y);
      CHECK(after.focal.x == Approx(scale * before.focal.x));
      CHECK(after.focal.y == Approx(scale * before.focal.y));
      CHECK(other.shift == lens.shift);
      CHECK(reshaped(other, aspect(to), aspect(from)).fov_y == Approx(lens.fov_y));
    }
  }
  CHECK(reshaped(lens, 1.5, 2.5) == lens);
  // Also after a window of a few pixels.
  CHECK(reshaped(reshaped({.fov_y = 2.0}, 1, 0.001), 0.001, 1).fov_y == Approx(2.0));
}

TEST_CASE("a camera's image stays whole in pictures of other shapes, also after it was left") {
  test::Random random(5);
  const Camera camera = randomCamera(random);
  for (const glm::ivec2 size : {glm::ivec2(900, 300), glm::ivec2(300, 900), glm::ivec2(640, 480)}) {
    const Lens moved = reshaped(lensOf(camera, 640.0 / 480.0), 640.0 / 480.0, static_cast<double>(size.x) / size.y);
    const Camera expected = fitted(camera, size.x, size.y), found = toCamera({}, moved, size.x, size.y);
    CHECK(glm::length(found.focal - expected.focal) < 1e-9);
    CHECK(glm::length(found.center - expected.center) < 1e-9);
  }
}

TEST_CASE("up is the mean of the cameras' up, and -y when that says nothing") {
  std::vector<Camera> cameras;
  CHECK(sceneUp(cameras) == glm::dvec3(0, -1, 0));
  for (const glm::dvec3 eye : {glm::dvec3(3, 0, 1), glm::dvec3(-3, 0, 1), glm::dvec3(0, 3, 1), glm::dvec3(0, -3, 1)}) {
    cameras.push_back(lookAt(eye, {0, 0, 0}, {0, 0, 1}, 0.8, 64, 64));
  }
  CHECK(glm::length(sceneUp(cameras) - glm::dvec3(0, 0, 1)) < 1e-12);
  cameras = {lookAt({0, 0, 0}, {0, 0, 1}, {0, 1, 0}, 0.8, 64, 64),
             lookAt({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 0.8, 64, 64)};
  CHECK(sceneUp(cameras) == glm::dvec3(0, -1, 0));
}

TEST_CASE("an axis as up: by name and back, and the view keeps its pivot under it") {
  const glm::dvec3 cameras_up = glm::normalize(glm::dvec3(1, 2, 3));
  CHECK(upOf(UpAxis::cameras, cameras_up) == cameras_up);
  CHECK(upOf(UpAxis::plusX, cameras_up) == glm::dvec3(1, 0, 0));
  CHECK(upOf(UpAxis::minusY, cameras_up) == glm::dvec3(0, -1, 0));
  CHECK(upOf(UpAxis::plusZ, cameras_up) == glm::dvec3(0, 0, 1));
  for (const UpAxis axis : valuesOf<UpAxis>()) CHECK(parse<UpAxis>(name(axis)) == axis);
  CHECK_FALSE(parse<UpAxis>("z"));
  const ViewPose pose = levelPose({0, -1, 0}, {3, 1, 2}, {0.5, 0, 0});
  const ViewPose other = leveled(pose, {0, 0, 1});
  CHECK(other.position == pose.position);
  CHECK(glm::length(other.pivot() - pose.pivot()) < 1e-9);
  CHECK(std::abs(glm::transpose(other.cameraFromWorldRotation())[0].z) < 1e-12);  // the image's x axis is level
}

TEST_CASE("bounds ignore a few far floaters and survive absurd scales") {
  GaussianModel model = test::trainedLikeModel(5, 400);
  const SceneBounds clean = sceneBounds(model);
  for (int i = 0; i < 8; ++i) model.mean[i] = glm::vec3(1e6f);
  model.log_scale[20] = glm::vec3(80.0f);
  const SceneBounds bounds = sceneBounds(model);
  CHECK(bounds.radius < 2 * clean.radius);
  CHECK(glm::length(bounds.center - clean.center) < 0.2 * clean.radius);
  for (glm::vec3& scale : model.log_scale) scale = glm::vec3(3000.0f);
  CHECK(std::isfinite(sceneBounds(model).radius));
  CHECK(sceneBounds(GaussianModel{}).radius == 1);
}

TEST_CASE("bounds are those of the subject, not of a far background of large Gaussians") {
  GaussianModel model = test::trainedLikeModel(5, 400);
  const SceneBounds clean = sceneBounds(model);
  for (std::size_t i = 0; i < model.size(); i += 7) {  // a seventh
    model.mean[i] *= 8.0f;
    model.log_scale[i] += 2.0f;
  }
  CHECK(sceneBounds(model).radius < 1.5 * clean.radius);
}

TEST_CASE("bounds hold the sparse body of a dense head") {
  GaussianModel model = test::trainedLikeModel(5, 400);
  test::Random random(6);
  for (std::size_t i = 0; i < model.size(); ++i) {
    const bool head = i % 5 != 0;
    model.mean[i] = head ? random.uniformVec3(-0.5, 0.5) : random.uniformVec3(-3, 3);
    model.log_scale[i] = glm::vec3(std::log(head ? 0.005f : 0.015f));
  }
  CHECK(sceneBounds(model).radius > 2.5);
}

TEST_CASE("the sides of a scene are looked at level, around the pivot, with its up at the top") {
  test::Random random(5);
  for (const glm::dvec3 up : {glm::dvec3(0, -1, 0), glm::dvec3(0, 0, 1), glm::dvec3(0, 1, 0)}) {
    ViewPose pose = levelPose(up, random.uniformVec3(-3, 3), random.uniformVec3(-1, 1));
    const glm::dvec3 pivot = pose.pivot();
    const auto forwardFrom = [&](Side side) {
      lookFrom(pose, side);
      CHECK(glm::distance(pose.pivot(), pivot) < 1e-9);
      checkRotation(pose.cameraFromWorldRotation());
      return pose.forward();
    };
    CHECK(glm::distance(forwardFrom(Side::top), -up) < 1e-9);
    const glm::dvec3 top_of_picture = -(glm::transpose(pose.cameraFromWorldRotation())[1]);
    CHECK(glm::distance(forwardFrom(Side::bottom), up) < 1e-9);
    const glm::dvec3 front = forwardFrom(Side::front), right = forwardFrom(Side::right);
    CHECK(glm::distance(top_of_picture, front) < 1e-9);
    CHECK(std::abs(glm::dot(front, up)) < 1e-9);
    CHECK(glm::distance(forwardFrom(Side::back), -front) < 1e-9);
    CHECK(glm::distance(forwardFrom(Side::left), -right) < 1e-9);
    // Who stands at the right looks to the left of who stands in front.
    CHECK(glm::distance(right, glm::cross(up, front)) < 1e-9);
  }
}

TEST_CASE("a pivot in front of the camera comes to the middle without a turn, one behind changes nothing") {
  ViewPose pose = levelPose({0, -1, 0}, {0, 0, -4}, {0.3, 0.2, 1});
  const ViewPose before = pose;
  const glm::dvec3 point = pose.position + 2.5 * pose.forward() + glm::dvec3(0.4, 0.3, 0);
  centerOn(pose, point);
  CHECK(glm::distance(pose.pivot(), point) < 1e-9);
  CHECK(pose.yaw == before.yaw);
  CHECK(pose.pitch == before.pitch);
  CHECK(pose.distance == Approx(glm::dot(point - before.position, before.forward())));
  const ViewPose after = pose;
  centerOn(pose, pose.position - pose.forward());
  CHECK(pose.position == after.position);
}
