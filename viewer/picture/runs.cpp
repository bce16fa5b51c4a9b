// SPDX-License-Identifier: Apache-2.0
// The life of a run, and the benchmark in a window; recording_run.cpp has the other one.
#include "viewer/picture/runs.h"

#include <cstdio>
#include <optional>
#include <utility>
#include <vector>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "viewer/picture/benchmark.h"
#include "viewer/picture/recording_run.h"
#include "viewer/view/shot.h"

namespace tg {
namespace {

// A benchmark in the window: each picture of options.path as it is shown, timed from the request to its arrival.
class BenchmarkRun final : public PictureRun {
 public:
  using Clock = std::chrono::steady_clock;

  // At that picture size. `started`: when the program was. Throws what shotCameras throws.
  BenchmarkRun(const ViewOptions& options, const Scene& scene, glm::ivec2 size, Clock::time_point started)
      : benchmark_(benchmarkOf(options, scene)), started_(started) {
    ViewOptions shot = options;
    shot.size = size;
    cameras_ = shotCameras(shot, scene, false);
    benchmark_.where = "window";
    benchmark_.width = size.x;
    benchmark_.height = size.y;
  }

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
  std::vector<Camera> cameras_;
  const Clock::time_point started_;
  std::optional<Clock::time_point> asked_;  // when the picture that is due was asked for
  double cpu_ = 0;                          // [ms] of the process then
  bool warm_ = false;
};

}  // namespace

bool PictureRuns::update(ViewerState& state, glm::ivec2 area) {
  try {
    if (!run_) {
      begin(state, area);
      return false;
    }
    const bool closed = streams() && documentOf(state, *streamed_) < 0;
    if (waitsFor(state.scene) != std::exchange(state.record.waits, waitsFor(state.scene)) && state.record.waits) {
      awaited_.reset();  // pictures of what is shown come between
      if (!closed) notify(state, "The recording goes on when " + streamed_->filename().string() + " is shown again");
    }
    if (!options_.benchmark && (!state.record.wanted || !state.scene.model || closed)) {
      fail(state, "Recording cancelled");
    } else if (run_->done() == run_->frames()) {
      const std::string result = run_->finish();
      if (options_.benchmark) state.quit = true;
      const bool leaves = state.desktop.after_recording;
      end(state, result);
      if (leaves) goOnClosing(state, {});
    } else {
      state.record.done = run_->done();
      state.record.frames = run_->frames();
    }
  } catch (const Error& error) {
    if (scripted_ || options_.benchmark) throw;
    fail(state, "");
    state.messages.error = error.what();
  }
  return !run_;
}

void PictureRuns::begin(const ViewerState& state, glm::ivec2 area) {
  if (options_.benchmark) {
    if (state.quit || !state.scene.model || state.scene.partial) return;
    run_ = std::make_unique<BenchmarkRun>(options_, state.scene, area, started_);
  } else if (state.record.wanted) {
    if (!state.scene.model) throw Error(ErrorKind::usage, "there is no model to record");
    run_ = std::make_unique<RecordingRun>(state);
  }
  if (run_ && state.scene.streamed_from > 0) streamed_ = state.scene.path;
}

void PictureRuns::end(ViewerState& state, const std::string& notice) {
  run_.reset();
  awaited_.reset();
  look_.reset();
  streamed_.reset();
  state.record.waits = false;
  state.record.wanted = false;
  state.desktop.after_recording = false;
  if (!notice.empty() && !scripted_) notify(state, notice);
}

void PictureRuns::fail(ViewerState& state, const std::string& notice) {
  end(state, notice);
  if (state.desktop.question && state.desktop.question->what == Unsaved::recording) keepUnsaved(state);
}

std::optional<PictureRequest> PictureRuns::due(const PictureRequest& view) {
  TG_ASSERT(run_, "a run is active");
  if (awaited_) return std::nullopt;
  const Camera* camera = run_->due();
  if (!camera) return std::nullopt;
  if (!look_) look_ = view;
  awaited_ = *look_;
  awaited_->camera = *camera;
  awaited_->in_run = true;
  if (streams()) awaited_->model = view.model;
  awaited_->other.reset();
  return awaited_;
}

bool PictureRuns::take(ViewerState& state, const Picture& picture, const std::function<Image()>& read) {
  if (!run_ || !awaited_ || !same(picture.request, *awaited_)) return false;
  awaited_.reset();
  try {
    run_->take(picture, read);
  } catch (const Error& error) {
    if (scripted_) throw;
    state.messages.error = error.what();
    fail(state, "");
  }
  return true;
}

void PictureRuns::giveUp(ViewerState& state, const std::string& problem) {
  if (!run_) return;
  if (options_.benchmark) throw Error(ErrorKind::device, problem);
  fail(state, "");
}

}  // namespace tg
