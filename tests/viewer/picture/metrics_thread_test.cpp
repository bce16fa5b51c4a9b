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
  std::shared_ptr<PicturePair> last;
  for (unsigned i = 0; i < 5; ++i) {
    last = std::make_shared<PicturePair>(PicturePair{test::noise(32, 24, i), test::noise(32, 24, i + 9), {}});
    thread.ask(last);
  }
  std::optional<MetricsThread::Result> result;
  for (int i = 0; i < 5000 && !(result && result->pair == last); ++i) {
    if (auto next = thread.take()) result = std::move(next);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  REQUIRE(result);
  CHECK(result->pair == last);
  REQUIRE(result->metrics);
  CHECK(result->metrics->psnr == psnr(last->other, last->first));
}
