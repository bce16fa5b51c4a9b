// SPDX-License-Identifier: Apache-2.0
// A recording takes every picture to its file; a benchmark takes its times.
#include "viewer/picture_run.h"

#include <cstdio>
#include <optional>
#include <utility>
#include <vector>

#include "viewer/shot.h"

namespace tg {
namespace {

class RecordingRun final : public PictureRun {
 public:
  explicit RecordingRun(const ViewerState& state) : recording_(state) {}
  const Camera* due() override { return recording_.due(); }
  void take(const Picture&, const std::function<Image()>& read) override { recording_.add(read()); }
  std::size_t done() const override { return recording_.done(); }
  std::size_t frames() const override { return recording_.frames(); }
  std::string finish() override {
    recording_.finish();
    return "Recorded " + recording_.out().string();
  }

 private:
  Recording recording_;
};

using Clock = std::chrono::steady_clock;

double milliseconds(Clock::duration duration) { return std::chrono::duration<double, std::milli>(duration).count(); }

class BenchmarkRun final : public PictureRun {
 public:
  BenchmarkRun(Benchmark benchmark, std::vector<Camera> cameras, Clock::time_point started)
      : benchmark_(std::move(benchmark)), cameras_(std::move(cameras)), started_(started) {}

  const Camera* due() override {
    if (done() == frames()) return nullptr;
    if (!asked_) {
      asked_ = Clock::now();
      cpu_ = processMilliseconds();
    }
    return &cameras_[done()];
  }

  void take(const Picture& picture, const std::function<Image()>&) override {
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

  std::size_t done() const override { return benchmark_.frames.size(); }
  std::size_t frames() const override { return cameras_.size(); }
  std::string finish() override {
    std::fputs(formatBenchmark(benchmark_).c_str(), stdout);
    return "";
  }

 private:
  Benchmark benchmark_;
  const std::vector<Camera> cameras_;
  const Clock::time_point started_;
  std::optional<Clock::time_point> asked_;  // when the picture that is due was asked for
  double cpu_ = 0;                          // [ms] of the process then
  bool warm_ = false;
};

}  // namespace

std::unique_ptr<PictureRun> makeRecordingRun(const ViewerState& state) { return std::make_unique<RecordingRun>(state); }

std::unique_ptr<PictureRun> makeBenchmarkRun(const ViewOptions& options, const Scene& scene, glm::ivec2 size,
                                             Clock::time_point started) {
  ViewOptions shot = options;
  shot.size = size;
  Benchmark benchmark = benchmarkOf(options, scene);
  benchmark.where = "window";
  benchmark.width = size.x;
  benchmark.height = size.y;
  return std::make_unique<BenchmarkRun>(std::move(benchmark), shotCameras(shot, scene, false), started);
}

}  // namespace tg
