// SPDX-License-Identifier: Apache-2.0
// Times pictures from the request to their arrival.
#include "viewer/picture/benchmark_run.h"

#include <cstdio>

#include "viewer/view/shot.h"

namespace tg {
namespace {

double milliseconds(BenchmarkRun::Clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

}  // namespace

BenchmarkRun::BenchmarkRun(const ViewOptions& options, const Scene& scene, glm::ivec2 size, Clock::time_point started)
    : benchmark_(benchmarkOf(options, scene)), started_(started) {
  ViewOptions shot = options;
  shot.size = size;
  cameras_ = shotCameras(shot, scene, false);
  benchmark_.where = "window";
  benchmark_.width = size.x;
  benchmark_.height = size.y;
}

const Camera* BenchmarkRun::due() {
  if (done() == frames()) return nullptr;
  if (!asked_) {
    asked_ = Clock::now();
    cpu_ = processMilliseconds();
  }
  return &cameras_[done()];
}

void BenchmarkRun::take(const Picture& picture, const std::function<Image()>&) {
  const Clock::time_point now = Clock::now();
  if (!warm_) {
    // The first picture of all: not counted, but it ends the loading.
    warm_ = true;
    benchmark_.load_ms = milliseconds(now - started_);
    benchmark_.device = picture.device;
    benchmark_.backend = picture.backend;
  } else {
    benchmark_.frames.push_back({milliseconds(now - *asked_), processMilliseconds() - cpu_, picture.passes});
  }
  asked_.reset();
}

std::string BenchmarkRun::finish() {
  std::fputs(formatBenchmark(benchmark_).c_str(), stdout);
  return "";
}

}  // namespace tg
