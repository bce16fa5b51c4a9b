// SPDX-License-Identifier: Apache-2.0
// --timings: how long the window's thread is held up, and how fast pictures follow one another.
#pragma once
#include <chrono>
#include <vector>

namespace tg {

class FrameTimings {
 public:
  using Clock = std::chrono::steady_clock;

  // What the window's thread spends in calls that may wait for the device or the screen; a frame has several.
  void held(Clock::duration duration) { held_ += duration; }
  void frameShown();
  void pictureArrived();
  // One line; nothing without a frame.
  void print() const;

 private:
  Clock::duration held_{};
  Clock::time_point last_picture_{};
  std::vector<double> held_ms_, between_ms_;
};

}  // namespace tg
