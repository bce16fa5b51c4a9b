// SPDX-License-Identifier: Apache-2.0
// A recording while the window lives: which picture is due next, and where it goes.
#pragma once
#include <string>
#include <vector>

#include "viewer/recorder.h"
#include "viewer/state.h"

namespace tg {

class Recording {
 public:
  // Of what the state asks for. Throws Error: usage, cannotWrite.
  explicit Recording(const ViewerState& state);

  // The camera of the picture that is due; null when there is none, or while the writer is behind.
  const Camera* due() const;
  void add(Image picture);  // of the camera that was due. Throws what stopped the writer
  bool complete() const { return done_ == cameras_.size(); }
  void finish();  // after the last picture: waits for the file. Throws as add does

  std::size_t done() const { return done_; }
  std::size_t frames() const { return cameras_.size(); }
  const std::filesystem::path& out() const { return recorder_.target().path; }

 private:
  std::vector<Camera> cameras_;
  Recorder recorder_;
  std::size_t done_ = 0;
};

}  // namespace tg
