// SPDX-License-Identifier: Apache-2.0
// What is measured last is what was asked for last.
#include "viewer/picture/metrics_thread.h"

#include <chrono>
#include <thread>

#include "core/image/metrics.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;

TEST_CASE("the metrics' thread answers for the newest pair") {
  MetricsThread thread([] {});
  Picture picture;
  std::uint64_t last = 0;
  for (unsigned i = 0; i < 5; ++i) {
    picture.pair = std::make_shared<PicturePair>(PicturePair{test::noise(32, 24, i), test::noise(32, 24, i + 9), {}});
    const std::uint64_t number = thread.ask(picture);
    CHECK(number > last);
    last = number;
  }
  std::optional<MetricsThread::Result> result;
  for (int i = 0; i < 60000 && !(result && result->number == last); ++i) {
    if (auto next = thread.take()) result = std::move(next);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  REQUIRE(result);
  CHECK(result->number == last);
  REQUIRE(result->metrics);
  CHECK(result->metrics->psnr == psnr(picture.pair->other, picture.pair->first));
}

TEST_CASE("a photograph of more pixels than are measured is measured at the largest size that has no more") {
  Camera camera = test::trainedLikeCamera(640, 480);
  CHECK(measuredCamera(camera).size == camera.size);
  camera.size = {6000, 4000};
  CHECK(measuredCamera(camera).size == glm::ivec2(2000, 1333));
}
