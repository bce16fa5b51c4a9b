// SPDX-License-Identifier: Apache-2.0
// Numbers of the SPZ format that reader and writer share.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace tg {

constexpr std::uint32_t kSpzMagic = 0x5053474e;  // "NGSP"
constexpr std::size_t kSpzHeaderBytes = 16;      // versions 2 and 3, the first bytes inside the gzip stream
constexpr std::size_t kSpz4HeaderBytes = 32;     // version 4, in the clear
constexpr float kSpzColorScale = 0.15f;          // byte = (DC coefficient * 0.15 + 0.5) * 255
constexpr float kSpzScaleStep = 1.0f / 16.0f;    // log scale = byte / 16 - 10
constexpr float kSpzLowestScale = -10.0f;
constexpr float kSpzShStep = 1.0f / 128.0f;  // SH coefficient = (byte - 128) / 128
constexpr int kSpzRotationBits = 9;          // magnitude of a component of at most sqrt(1/2), version 3 and later

enum SpzFlags : std::uint8_t { kSpzAntialiased = 1, kSpzExtensions = 2 };

// Attributes in file order.
enum SpzStream { kSpzPositions, kSpzAlphas, kSpzColors, kSpzScales, kSpzRotations, kSpzSh, kSpzStreams };

struct SpzHeader {
  std::uint32_t version = 0;
  std::uint32_t count = 0;
  int sh_degree = 0;        // 0..4
  int fractional_bits = 0;  // of the 24-bit positions
  std::uint8_t flags = 0;

  // [bytes] of each stream.
  std::array<std::uint64_t, kSpzStreams> sizes() const {
    const std::uint64_t n = count;
    const std::uint64_t rest = static_cast<std::uint64_t>((sh_degree + 1) * (sh_degree + 1) - 1);
    return {9 * n, n, 3 * n, 3 * n, (version == 2 ? 3 : 4) * n, 3 * rest * n};
  }
};

}  // namespace tg
