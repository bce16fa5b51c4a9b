// SPDX-License-Identifier: Apache-2.0
// Atlas texels as bytes: value = byte / 255 * scale + offset, per channel.
#pragma once
#include <array>
#include <cstdint>

#include "core/atlas.h"
#include "core/image.h"

namespace tg {

struct QuantizedPage {
  Image color;  // 3 channels of multiples of 1/255
  Image alpha;  // 1 channel
  std::array<double, 4> scale{1, 1, 1, 1};
  std::array<double, 4> offset{0, 0, 0, 0};
  std::uint64_t clipped_texels = 0;
};

// Colour: a channel with negative values has byte 128 stand for exactly 0, any other channel byte 0. The range is the
// largest magnitude or the 99.9 percentile of the magnitudes, whichever loses less in the mean square. Alpha: [0, 1].
QuantizedPage quantizePage(const AtlasPage& page);

}  // namespace tg
