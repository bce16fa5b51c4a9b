// SPDX-License-Identifier: Apache-2.0
// What of a scene views have in their pictures, and how many of them stand for all.
#include "core/model/views.h"

#include "support/catch.h"

namespace tg {
namespace {

// In a row, 4 apart; each sees 2 to either side of its middle at the distance 4.
std::vector<Camera> row(int count) {
  std::vector<Camera> views;
  for (int i = 0; i < count; ++i) {
    Camera& view = views.emplace_back();
    view.size = {40, 20};
    view.focal = {40, 40};
    view.center = {20, 10};
    view.translation = {-4.0 * i, 0, 0};
  }
  return views;
}

TEST_CASE("a point is in the pictures of those before which it lies") {
  const std::vector<Camera> views = row(3);
  const std::vector<glm::vec3> points = {{0, 0, 4}, {2.1f, 0, 8}, {4, 0.9f, 2}, {4, 0, -1}};
  const std::vector<Sighting> found = sightings(points, views);
  REQUIRE(found.size() == 4);
  CHECK(found[0].views == 1);
  CHECK(found[0].nearest == 4);
  CHECK(found[1].views == 2);
  CHECK(found[1].nearest == 8);
  CHECK(found[2].views == 0);  // above the picture
  CHECK(found[3].views == 0);  // behind
  CHECK(sightings({}, views).empty());
  CHECK(sightings(std::vector(10'000, points[0]), views).size() == 5000);
}

TEST_CASE("where each view sees a place of its own, all are needed, and where all see all, the least") {
  const std::vector<Camera> views = row(100);
  std::vector<glm::vec3> points;
  for (int i = 0; i < 100; ++i) points.emplace_back(4.0f * static_cast<float>(i), 0.0f, 4.0f);
  CHECK(viewsForAll(points, views, 16) == 100);
  CHECK(viewsForAll(points, std::span(views).first(10), 16) == 16);
  CHECK(viewsForAll({}, views, 16) == 16);
  for (glm::vec3& point : points) point.z = 40;  // in ten pictures, at the row's ends in fewer
  CHECK(viewsForAll(points, views, 16) == 60);
  points = {{200, 0, 1000}, {0, 0, -1}};
  CHECK(viewsForAll(points, views, 16) == 16);
}

TEST_CASE("views are taken evenly") {
  const std::vector<Camera> views = row(7);
  const std::vector<Camera> some = evenly(views, 3);
  REQUIRE(some.size() == 3);
  CHECK(some[1].translation == views[2].translation);
  CHECK(some[2].translation == views[4].translation);
  CHECK(evenly(views, 9).size() == 7);
  CHECK(evenly({}, 9).empty());
}

}  // namespace
}  // namespace tg
