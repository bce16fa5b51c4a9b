// SPDX-License-Identifier: Apache-2.0
// Begins, feeds and ends the recording or benchmark that the state or the options ask for.
#pragma once
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "viewer/picture/picture.h"
#include "viewer/view/options.h"
#include "viewer/view/state.h"

namespace tg {

// Pictures that the window draws one after the other by themselves: a recording, or a benchmark.
class PictureRun {
 public:
  virtual ~PictureRun() = default;
  // The camera of the picture that is due; null while there is none.
  virtual const Camera* due() = 0;
  // The picture of the camera that was due. `read` fetches its pixels. Throws Error.
  virtual void take(const Picture& picture, const std::function<Image()>& read) = 0;
  virtual std::size_t done() const = 0;
  virtual std::size_t frames() const = 0;
  // Once all are done: waits for what is still under way, and says what came of it. Throws Error.
  virtual std::string finish() = 0;
};

class PictureRuns {
 public:
  // `started`: when the program was. `scripted`: failures are thrown instead of shown, and nothing is announced.
  PictureRuns(const ViewOptions& options, std::chrono::steady_clock::time_point started, bool scripted)
      : options_(options), started_(started), scripted_(scripted) {}

  bool active() const { return run_ != nullptr; }
  // The camera of the picture that is due; null while there is none.
  const Camera* next() { return run_ ? run_->due() : nullptr; }
  // Whether the run draws the levels of a streamed scene, each picture its own. They come while it is shown.
  bool streams() const { return run_ && streamed_; }
  bool waitsFor(const Scene& shown) const { return streams() && shown.path != *streamed_; }

  // Once a frame. `area`: of the picture [px]. True when a run has ended: what was asked for last is no longer wanted.
  // Throws Error with a script or a benchmark.
  bool update(ViewerState& state, glm::ivec2 area);
  // The picture that the run waits for, once for each: the run's first `view` with the run's camera, and, where it
  // streams, with the levels of `view`. None: it is on its way, or none is due.
  std::optional<PictureRequest> due(const PictureRequest& view);
  // Whether the picture was made for the run, which takes it; `read` fetches its pixels.
  bool take(ViewerState& state, const Picture& picture, const std::function<Image()>& read);
  // The picture on its way will not come, but may be asked for again.
  void forget() { awaited_.reset(); }
  // No picture will come any more. Throws Error(device) with `problem` for a benchmark.
  void giveUp(ViewerState& state, const std::string& problem);

 private:
  void begin(const ViewerState& state, glm::ivec2 area);
  void end(ViewerState& state, const std::string& notice);
  void fail(ViewerState& state, const std::string& notice);  // nothing closes that was to wait for it

  const ViewOptions options_;
  const std::chrono::steady_clock::time_point started_;
  const bool scripted_;
  std::unique_ptr<PictureRun> run_;
  std::optional<PictureRequest> awaited_;
  std::optional<PictureRequest> look_;  // model, settings and output of all its pictures
  std::optional<std::filesystem::path> streamed_;  // the scene, where it is streamed
};

}  // namespace tg
