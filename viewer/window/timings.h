// SPDX-License-Identifier: Apache-2.0
// --timings: what takes how long, on stdout.
#pragma once
#include <chrono>
#include <vector>

#include "viewer/model/open_models.h"

namespace tg {

// How long the window's thread is held up, and how fast pictures follow one another.
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

// From the start of the program to the pictures of the first model.
class LoadTimings {
 public:
  explicit LoadTimings(std::chrono::steady_clock::time_point started) : started_(started) {}

  // Once per picture that has come. `whole`: it shows all of the model at full size; the first such one is printed to
  // stdout, with the first of all.
  void take(bool whole, const Scene& scene, const OpenModels& documents);

 private:
  const std::chrono::steady_clock::time_point started_;
  double first_ = 0;      // [s] from the start to the first picture; 0: not yet
  double first_cpu_ = 0;  // [s] of the process until then
  bool printed_ = false;
};

}  // namespace tg
