// SPDX-License-Identifier: Apache-2.0
// A recording while the window lives: which picture is due next, and where it goes.
#pragma once
#include <string>
#include <vector>

#include "viewer/picture/frame_writer.h"
#include "viewer/picture/runs.h"
#include "viewer/view/state.h"

namespace tg {

class RecordingRun final : public PictureRun {
 public:
  // Of what the state asks for. Throws Error: usage, cannotWrite.
  explicit RecordingRun(const ViewerState& state);

  const Camera* due() override;  // null also while the writer is behind
  void take(const Picture& picture, const std::function<Image()>& read) override;  // throws what stopped the writer
  std::size_t done() const override { return done_; }
  std::size_t frames() const override { return cameras_.size(); }
  std::string finish() override;

 private:
  std::vector<Camera> cameras_;
  FrameWriter writer_;
  std::size_t done_ = 0;
};

}  // namespace tg
