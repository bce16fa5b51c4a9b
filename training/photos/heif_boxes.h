// SPDX-License-Identifier: Apache-2.0
// Boxes of a HEIC or AVIF (ISO/IEC 14496-12). Private to training/photos.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace tg {

constexpr std::size_t kFullBoxBytes = 4;  // version and flags

constexpr std::uint32_t boxType(const char (&name)[5]) {
  std::uint32_t value = 0;
  for (int k = 0; k < 4; ++k) value = value << 8 | static_cast<unsigned char>(name[k]);
  return value;
}

// Takes big-endian numbers and boxes off the front; nothing once too few bytes are left.
class BoxCursor {
 public:
  using Bytes = std::span<const std::uint8_t>;

  explicit BoxCursor(Bytes bytes) : left_(bytes) {}

  std::optional<std::uint64_t> number(std::size_t bytes) {
    if (left_.size() < bytes) return std::nullopt;
    std::uint64_t value = 0;
    for (std::size_t k = 0; k < bytes; ++k) value = value << 8 | left_[k];
    left_ = left_.subspan(bytes);
    return value;
  }

  // As many as are there, at most.
  Bytes take(std::uint64_t bytes) {
    const Bytes taken = left_.first(std::min<std::uint64_t>(bytes, left_.size()));
    left_ = left_.subspan(taken.size());
    return taken;
  }

  struct Box {
    std::uint32_t type;
    Bytes content;
  };
  // One that says to be longer than what is there ends with it.
  std::optional<Box> box() {
    const std::size_t before = left_.size();
    const auto size = number(4), type = number(4);
    if (!size || !type) return std::nullopt;
    std::uint64_t length = *size;
    if (length == 1) length = number(8).value_or(0);
    if (length == 0) length = before;
    const std::size_t head = before - left_.size();
    if (length < head) return std::nullopt;
    return Box{static_cast<std::uint32_t>(*type), take(length - head)};
  }

  Bytes left() const { return left_; }

 private:
  Bytes left_;
};

}  // namespace tg
