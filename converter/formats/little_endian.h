// SPDX-License-Identifier: Apache-2.0
// Numbers in files, lowest byte first.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tg {

// `bytes` reach to `at` + 4.
inline std::uint32_t readU32(std::span<const std::uint8_t> bytes, std::size_t at) {
  return bytes[at] | std::uint32_t{bytes[at + 1]} << 8 | std::uint32_t{bytes[at + 2]} << 16 |
         std::uint32_t{bytes[at + 3]} << 24;
}

inline std::uint64_t readU64(std::span<const std::uint8_t> bytes, std::size_t at) {
  return readU32(bytes, at) | std::uint64_t{readU32(bytes, at + 4)} << 32;
}

// The lower 32 bits of `value`.
inline void appendU32(std::vector<std::uint8_t>& bytes, std::uint64_t value) {
  for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::uint8_t>(value >> shift));
}

inline void appendU64(std::vector<std::uint8_t>& bytes, std::uint64_t value) {
  appendU32(bytes, value);
  appendU32(bytes, value >> 32);
}

}  // namespace tg
