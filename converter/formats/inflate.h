// SPDX-License-Identifier: Apache-2.0
// Decompresses bytes in memory to a known size: what a hostile stream can cost is bounded before it is read.
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace tg {

// Whether there are none but zeros, as those are that fill a file or a buffer view up.
bool isPadding(std::span<const std::uint8_t> bytes);

// A gzip stream of one member or several (deflate cannot deliver more than 1032 times its size). Reading behind the
// last one's end throws Error(badData) where other bytes than padding follow it.
class GzipBytes {
 public:
  // `bytes` must outlive this; `path` starts the messages.
  GzipBytes(std::span<const std::uint8_t> bytes, std::string path);
  ~GzipBytes();
  GzipBytes& operator=(GzipBytes&&) = delete;

  // The next `size` bytes. Throws Error(badData) when the stream is broken or ends before them; `what` names them.
  std::vector<std::uint8_t> take(std::uint64_t size, const std::string& what);
  // Reads on to the end and its checksum; the bytes that were left. Throws Error(badData) beyond `limit`.
  std::vector<std::uint8_t> takeRest(std::uint64_t limit);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// One whole Zstandard stream of exactly `size` bytes, which are taken before it is read: they must be bounded by the
// caller. Throws Error(badData) when the stream is broken or of another size; `what` names it.
std::vector<std::uint8_t> unpackZstandard(std::span<const std::uint8_t> bytes, std::uint64_t size,
                                          const std::string& path, const std::string& what);

}  // namespace tg
