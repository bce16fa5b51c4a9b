// SPDX-License-Identifier: Apache-2.0
// One picture after the other.
#include "viewer/recording.h"

#include <utility>

#include "viewer/path_editor.h"

namespace tg {
namespace {

RecordTarget targetOf(const ViewerState& state) { return parseRecordTarget(state.record.out, "recording"); }

}  // namespace

Recording::Recording(const ViewerState& state)
    : cameras_(recordCameras(state, recordSize(targetOf(state), state.record.size))),
      recorder_(targetOf(state), {cameras_.front().width, cameras_.front().height}, state.record.fps) {}

const Camera* Recording::due() const { return complete() || !recorder_.ready() ? nullptr : &cameras_[done_]; }

void Recording::add(Image picture) {
  recorder_.add(std::move(picture));
  ++done_;
}

void Recording::finish() { recorder_.finish(); }

}  // namespace tg
