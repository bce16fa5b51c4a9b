// SPDX-License-Identifier: Apache-2.0
// Collects and prints.
#include "viewer/window/timings.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "viewer/picture/benchmark.h"
#include "viewer/picture/picture.h"

namespace tg {

void FrameTimings::frameShown() { held_ms_.push_back(milliseconds(std::exchange(held_, Clock::duration{}))); }

void FrameTimings::pictureArrived() {
  const Clock::time_point now = Clock::now();
  if (last_picture_ != Clock::time_point{}) between_ms_.push_back(milliseconds(now - last_picture_));
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

void LoadTimings::take(bool whole, const Scene& scene, const OpenModels& documents) {
  if (printed_) return;
  const double now = std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
  const double cpu = processMilliseconds() / 1e3;
  if (first_ == 0) {
    first_ = now;
    first_cpu_ = cpu;
  }
  if (!whole) return;
  printed_ = true;
  const double gigabytes = static_cast<double>(documents.readBytes()) / 1e9;
  const double read = std::max(documents.readSeconds(), 1e-9);
  std::printf("%s: %.1f MB read in %.2f s (%.2f GB/s)\n", scene.path.c_str(), 1e3 * gigabytes, read, gigabytes / read);
  std::printf("first picture after %.2f s (%.2f s of CPU time), all of it after %.2f s (%.2f s, %.2f GB/s from disk)\n",
              first_, first_cpu_, now, cpu, gigabytes / now);
  std::fflush(stdout);
}

}  // namespace tg
