// SPDX-License-Identifier: Apache-2.0
// How far a file has been read, for whoever waits for it in another thread; and the way to stop.
#pragma once
#include <atomic>
#include <cmath>
#include <cstdint>
#include <exception>
#include <functional>

#include "core/model.h"

namespace tg {

// Thrown out of a reader that was told to stop.
struct ReadCancelled : std::exception {
  const char* what() const noexcept override { return "reading was cancelled"; }
};

struct ReadProgress {
  std::atomic<std::uint64_t> done{0};   // [bytes] of the file
  std::atomic<std::uint64_t> total{0};  // [bytes]; 0: not known yet
  std::atomic<bool> cancel{false};
  // Set before reading: receives a part of a large model, spread evenly over what has been read so far, without
  // textures. Called in the reader's thread, now and then; formats that are read at once do not call it.
  std::function<void(GaussianModel part)> preview;

  // Throws ReadCancelled when told to.
  void advance(std::uint64_t bytes) {
    done += bytes;
    if (cancel) throw ReadCancelled();
  }
};

constexpr std::size_t kPreviewGaussians = 100'000;  // in a part, at most

// What the log scales of a part of `part` Gaussians grow by, so that it covers the surfaces of all `whole` of them.
inline float previewGrowth(std::size_t whole, std::size_t part) {
  return part == 0 ? 0.0f : 0.5f * std::log(static_cast<float>(whole) / static_cast<float>(part));
}

}  // namespace tg
