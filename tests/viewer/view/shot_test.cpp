// SPDX-License-Identifier: Apache-2.0
// What the options ask of a scene.
#include "viewer/view/shot.h"

#include "core/system/error.h"
#include "shared/limits.h"
#include "support/catch.h"

using namespace tg;

TEST_CASE("without --camera: the first test camera, else the first, else the whole model") {
  Scene scene;
  ViewOptions options;
  const Camera whole = cameraFor(options, scene);
  CHECK(whole.size.x == 1280);
  CHECK(whole.size.y == 720);
  for (int i = 0; i < 3; ++i) {
    scene.cameras.push_back(lookAt({0, 0, -2}, {0, 0, 0}, {0, -1, 0}, 0.8, 64 + i, 48));
  }
  CHECK(cameraFor(options, scene).size.x == 64);
  scene.cameras[2].test = true;
  CHECK(cameraFor(options, scene).size.x == 66);
  options.size = glm::ivec2(200, 100);
  CHECK(cameraFor(options, scene).size.x == 200);
  options.size.reset();
  scene.cameras[2].size.x = 1 << 20;
  CHECK_THROWS_AS(cameraFor(options, scene), Error);
}

TEST_CASE("a near plane closer by brings the view of a tiny model closer") {
  Scene scene;
  scene.bounds.radius = 0.005;
  ViewOptions options;
  CHECK(glm::length(cameraFor(options, scene).position()) > double{kNear});
  options.settings.near = 1e-4f;
  CHECK(glm::length(cameraFor(options, scene).position()) < 0.02);
}
