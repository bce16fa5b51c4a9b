// SPDX-License-Identifier: Apache-2.0
// Inflates a gzip file piece by piece, with a guard against bombs. Private to core.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

namespace tg {

struct ByteProgress;

// A thread of its own inflates ahead of what has been taken, by a few MiB.
class GzipReader {
 public:
  // `progress`, which may be null, hears of the file's bytes. Throws Error(cannotRead) when the file cannot be opened.
  GzipReader(const std::filesystem::path& path, std::uint64_t max_inflated_bytes, ByteProgress* progress = nullptr);
  ~GzipReader();
  GzipReader& operator=(GzipReader&&) = delete;

  // The next piece, valid until the next call; empty at the end. Throws Error(badData) when the stream is broken or
  // cut, fails its checksum, inflates more than 1000 : 1 after the first MiB, or beyond the limit; ReadCancelled.
  std::span<const std::uint8_t> next();

  // More bytes than this cannot come out of the file.
  std::uint64_t inflatedBound() const;
  // After the end: bytes follow the gzip stream, which nobody has looked at.
  bool hasTrailingBytes() const;

 private:
  struct State;
  class Ahead;
  std::unique_ptr<State> state_;  // the thread's until the end
  std::unique_ptr<Ahead> ahead_;
};

}  // namespace tg
