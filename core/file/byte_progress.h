// SPDX-License-Identifier: Apache-2.0
// How far a file has been read, for whoever waits for it in another thread; and the way to stop.
#pragma once
#include <atomic>
#include <cstdint>
#include <exception>

namespace tg {

// Thrown out of a reader that was told to stop.
struct ReadCancelled : std::exception {
  const char* what() const noexcept override { return "reading was cancelled"; }
};

struct ByteProgress {
  std::atomic<std::uint64_t> done{0};   // [bytes] of the file
  std::atomic<std::uint64_t> total{0};  // [bytes]; 0: not known yet
  std::atomic<bool> cancel{false};

  // Throws ReadCancelled when told to.
  void advance(std::uint64_t bytes) {
    done += bytes;
    if (cancel) throw ReadCancelled();
  }
};

}  // namespace tg
