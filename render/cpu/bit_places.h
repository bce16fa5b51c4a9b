// SPDX-License-Identifier: Apache-2.0
// Which bits of a byte are set: how the lanes that a mask keeps move together. Highway's own Compress of 1.0.3 copies
// its table to the stack at every call when GCC compiles it.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

namespace tg::cpu {

// The places of the set bits of every byte, ascending, then zeros.
inline constexpr auto kBitPlaces = [] {
  std::array<std::array<std::uint8_t, 8>, 256> places{};
  for (std::size_t byte = 0; byte < places.size(); ++byte) {
    std::size_t count = 0;
    for (std::uint8_t bit = 0; bit < 8; ++bit) {
      if ((byte >> bit & 1) != 0) places[byte][count++] = bit;
    }
  }
  return places;
}();

}  // namespace tg::cpu
