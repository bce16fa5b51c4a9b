// SPDX-License-Identifier: Apache-2.0
// Handles under the pointer, and what dragging them does.
#include "viewer/view/gizmo.h"

#include <cmath>

#include "support/catch.h"

using namespace tg;

namespace {

const Camera kCamera = lookAt({3, -2, -6}, {0, 0, 0}, {0, -1, 0}, 0.8, 800, 600);

glm::dvec2 pixelOf(glm::dvec3 p) { return project(kCamera, cameraFromWorld(kCamera, p)); }
glm::dvec3 moved(const Similarity& s, glm::dvec3 p) { return s.scale * (s.rotation * p) + s.translation; }
glm::dvec3 axis(int k) {
  glm::dvec3 a(0.0);
  a[k] = 1;
  return a;
}
Handle handle(int k) { return static_cast<Handle>(static_cast<int>(Handle::x) + k); }

}  // namespace

TEST_CASE("handles have one size on screen wherever they are, and none behind the camera") {
  for (const double distance : {1.0, 5.0, 50.0}) {
    const Camera camera = lookAt({0, 0, -distance}, {0, 0, 0}, {0, -1, 0}, 0.8, 800, 600);
    const auto gizmo = gizmoAt(GizmoKind::move, {0, 0, 0}, camera);
    REQUIRE(gizmo);
    const auto at = [&](glm::dvec3 p) { return project(camera, cameraFromWorld(camera, p)); };
    CHECK(glm::distance(at({gizmo->size, 0, 0}), at({0, 0, 0})) == Approx(80));
  }
  CHECK_FALSE(gizmoAt(GizmoKind::move, {3, -2, -9}, kCamera));
}

TEST_CASE("handles are larger, and reached from farther, where the user wants things larger") {
  const Gizmo usual = *gizmoAt(GizmoKind::move, {0.3, 0.2, -0.1}, kCamera);
  const Gizmo large = *gizmoAt(GizmoKind::move, usual.origin, kCamera, 2);
  CHECK(large.size == Approx(2 * usual.size));
  const glm::dvec2 middle = pixelOf(usual.origin);
  CHECK(handleAt(usual, kCamera, middle + glm::dvec2(15, 15)) != Handle::view);
  CHECK(handleAt(large, kCamera, middle + glm::dvec2(15, 15)) == Handle::view);
  for (const Gizmo& gizmo : {usual, large}) {
    const glm::dvec2 tip = gizmoLines(gizmo, kCamera).front().points.back(), out = glm::normalize(tip - middle);
    CHECK(handleAt(gizmo, kCamera, tip + 7 * gizmo.unit * out) == Handle::x);
    CHECK(handleAt(gizmo, kCamera, tip + 9 * gizmo.unit * out) == Handle::none);
  }
  // From the middle of the scale's ring as much as an axis is long.
  const Gizmo ring = *gizmoAt(GizmoKind::scale, usual.origin, kCamera, 2);
  const Similarity s = dragged(ring, Handle::view, kCamera, middle, middle + glm::dvec2(160, 0));
  CHECK(s.scale == Approx(std::exp(1.0)));
}

TEST_CASE("an arrow moves along its axis, and what it was dragged by stays under the pointer") {
  const Gizmo gizmo = *gizmoAt(GizmoKind::move, {0.3, 0.2, -0.1}, kCamera);
  for (int k = 0; k < 3; ++k) {
    CAPTURE(k);
    const glm::dvec3 grip = gizmo.origin + 0.8 * gizmo.size * axis(k), goal = grip + 1.7 * axis(k);
    CHECK(handleAt(gizmo, kCamera, pixelOf(grip)) == handle(k));
    const Similarity s = dragged(gizmo, handle(k), kCamera, pixelOf(grip), pixelOf(goal));
    CHECK(s.scale == 1);
    CHECK(s.rotation == glm::dmat3(1.0));
    CHECK(glm::distance(s.translation, 1.7 * axis(k)) < 1e-9);
  }
  CHECK(handleAt(gizmo, kCamera, {5, 5}) == Handle::none);
}

TEST_CASE("the square moves in the plane of the picture") {
  const Gizmo gizmo = *gizmoAt(GizmoKind::move, {0.3, 0.2, -0.1}, kCamera);
  const glm::dvec2 from = pixelOf(gizmo.origin), to = from + glm::dvec2(30, -50);
  CHECK(handleAt(gizmo, kCamera, from) == Handle::view);
  const Similarity s = dragged(gizmo, Handle::view, kCamera, from, to);
  CHECK(glm::distance(pixelOf(moved(s, gizmo.origin)), to) < 1e-9);
  CHECK(std::abs((kCamera.rotation * s.translation).z) < 1e-12);
}

TEST_CASE("a ring turns about its axis through the middle, by the angle between the ends") {
  const Gizmo gizmo = *gizmoAt(GizmoKind::turn, {0.3, 0.2, -0.1}, kCamera);
  for (int k = 0; k < 3; ++k) {
    CAPTURE(k);
    const glm::dvec3 u = axis((k + 1) % 3), v = axis((k + 2) % 3);
    const auto on_ring = [&](double angle) {
      return gizmo.origin + gizmo.size * (std::cos(angle) * u + std::sin(angle) * v);
    };
    for (const double turn : {0.4, -1.1, 2.5}) {
      const Similarity s = dragged(gizmo, handle(k), kCamera, pixelOf(on_ring(0.3)), pixelOf(on_ring(0.3 + turn)));
      CHECK(glm::distance(moved(s, gizmo.origin), gizmo.origin) < 1e-12);
      CHECK(glm::distance(moved(s, on_ring(0.3)), on_ring(0.3 + turn)) < 1e-9);
      CHECK(glm::distance(s.rotation * axis(k), axis(k)) < 1e-12);
    }
  }
  const glm::dvec2 beside = pixelOf(gizmo.origin) + glm::dvec2(96, 0);
  CHECK(handleAt(gizmo, kCamera, beside) == Handle::view);
}

TEST_CASE("a ring that is seen from its edge turns along its line") {
  const Camera camera = lookAt({0, 0, -5}, {0, 0, 0}, {0, -1, 0}, 0.8, 800, 600);
  const Gizmo gizmo = *gizmoAt(GizmoKind::turn, {0, 0, 0}, camera);
  const glm::dvec2 middle(400, 300);
  // About y, whose ring is a level line here: its near side goes with the pointer.
  const Similarity s = dragged(gizmo, Handle::y, camera, middle, middle + glm::dvec2(40, 0));
  const glm::dvec3 near_side = moved(s, {0, 0, -1});
  CHECK(near_side.x == Approx(std::sin(0.5)).epsilon(1e-6));
  CHECK(near_side.y == Approx(0).margin(1e-12));
}

TEST_CASE("scaling is the ratio of the distances from the middle, which stays") {
  const Gizmo gizmo = *gizmoAt(GizmoKind::scale, {0.3, 0.2, -0.1}, kCamera);
  const glm::dvec2 middle = pixelOf(gizmo.origin);
  CHECK(handleAt(gizmo, kCamera, middle + glm::dvec2(0, 80)) == Handle::view);
  const Similarity s = dragged(gizmo, Handle::view, kCamera, middle + glm::dvec2(80, 0), middle + glm::dvec2(0, 120));
  CHECK(s.scale == Approx(1.5));
  CHECK(glm::distance(moved(s, gizmo.origin), gizmo.origin) < 1e-12);
  const Similarity tiny = dragged(gizmo, Handle::view, kCamera, middle + glm::dvec2(80, 0), middle);
  CHECK(tiny.scale > 0);
  CHECK(dragged(gizmo, Handle::view, kCamera, middle, middle + glm::dvec2(40, -40)).scale > 1);
}
