// SPDX-License-Identifier: Apache-2.0
#include "viewer/picture/runs.h"

#include "core/system/assert.h"
#include "core/system/error.h"
#include "viewer/picture/benchmark_run.h"
#include "viewer/picture/recording_run.h"

namespace tg {

bool PictureRuns::update(ViewerState& state, glm::ivec2 area) {
  try {
    if (!run_) {
      begin(state, area);
      return false;
    }
    if (!options_.benchmark && !state.record.wanted) {
      end(state, "Recording cancelled");
    } else if (run_->done() == run_->frames()) {
      const std::string result = run_->finish();
      if (options_.benchmark) state.quit = true;
      end(state, result);
    } else {
      state.record.done = run_->done();
      state.record.frames = run_->frames();
    }
  } catch (const Error& error) {
    if (scripted_ || options_.benchmark) throw;
    end(state, "");
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
}

void PictureRuns::end(ViewerState& state, const std::string& notice) {
  run_.reset();
  awaited_.reset();
  state.record.wanted = false;
  if (!notice.empty() && !scripted_) notify(state, notice);
}

std::optional<PictureRequest> PictureRuns::due(const PictureRequest& view) {
  TG_ASSERT(run_, "a run is active");
  if (awaited_) return std::nullopt;
  const Camera* camera = run_->due();
  if (!camera) return std::nullopt;
  awaited_ = view;
  awaited_->camera = *camera;
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
    end(state, "");
  }
  return true;
}

void PictureRuns::giveUp(ViewerState& state, const std::string& problem) {
  if (!run_) return;
  if (options_.benchmark) throw Error(ErrorKind::device, problem);
  end(state, "");
}

}  // namespace tg
