// SPDX-License-Identifier: Apache-2.0
#include "viewer/window/frame_timings.h"

#include <cstdio>
#include <utility>

#include "viewer/picture/benchmark.h"

namespace tg {
namespace {

double millisecondsOf(FrameTimings::Clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

}  // namespace

void FrameTimings::frameShown() { held_ms_.push_back(millisecondsOf(std::exchange(held_, Clock::duration{}))); }

void FrameTimings::pictureArrived() {
  const Clock::time_point now = Clock::now();
  if (last_picture_ != Clock::time_point{}) between_ms_.push_back(millisecondsOf(now - last_picture_));
  last_picture_ = now;
}

void FrameTimings::print() const {
  if (held_ms_.empty()) return;
  const Spread held = spreadOf(held_ms_);
  std::printf("%zu frames of the window, held up for %.2f ms (median; 95 %%: %.2f ms)", held_ms_.size(), held.median,
              held.p95);
  if (!between_ms_.empty()) {
    std::printf("; %zu pictures, %.2f ms from one to the next (median)", between_ms_.size() + 1,
                spreadOf(between_ms_).median);
  }
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace tg
