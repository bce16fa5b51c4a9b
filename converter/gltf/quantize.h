// SPDX-License-Identifier: Apache-2.0
// Atlas texels as integers: value = stored / largest * scale + offset, per channel; largest is 255 or 65535.
#pragma once
#include <array>
#include <cstdint>

#include "core/image/image.h"
#include "core/model/atlas.h"

namespace tg {

struct QuantizedPage {
  Image color;  // 3 channels of multiples of 1/largest
  Image alpha;  // 1 channel
  std::array<double, 4> scale{1, 1, 1, 1};
  std::array<double, 4> offset{0, 0, 0, 0};
  std::uint64_t clipped_texels = 0;
};

// Colour: a channel with negative values has 128 (32768) stand for exactly 0, any other channel 0. The range is the
// largest magnitude or the 99.9 percentile of the magnitudes, whichever loses less in the mean square. Alpha: [0, 1].
// bits: 8 or 16.
QuantizedPage quantizePage(const Image& page, int bits = 8);

}  // namespace tg
