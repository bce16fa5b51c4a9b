// SPDX-License-Identifier: Apache-2.0
// One picture after the other.
#include "viewer/picture/recording_run.h"

#include "core/system/assert.h"
#include "viewer/view/path_editor.h"

namespace tg {
namespace {

// The window's pictures have colours: the numbers of an .exr come from a program without one.
RecordTarget targetOf(const ViewerState& state) {
  const std::filesystem::path& out = state.record.out;
  return parseRecordTarget(out, out.empty() ? "recording" : out.string(), false);
}

}  // namespace

RecordingRun::RecordingRun(const ViewerState& state)
    : cameras_(recordCameras(state, recordSize(targetOf(state), state.record.size))),
      writer_(targetOf(state), cameras_.front().size, state.record.fps, cameras_.size()) {}

const Camera* RecordingRun::due() { return done_ == cameras_.size() || !writer_.ready() ? nullptr : &cameras_[done_]; }

void RecordingRun::take(const Picture&, const std::function<Image()>& read) {
  TG_ASSERT(done_ < cameras_.size(), "a picture was due");
  writer_.add(read());
  ++done_;
}

std::string RecordingRun::finish() {
  TG_ASSERT(done_ == cameras_.size(), "the last picture is there");
  writer_.finish();
  return "Recorded " + writer_.target().path.string();
}

}  // namespace tg
