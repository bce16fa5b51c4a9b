// SPDX-License-Identifier: Apache-2.0
// PNG files with more levels than core/image/image.h writes.
#pragma once
#include <cstdint>
#include <vector>

#include "core/image/image.h"

namespace tg {

// 16 bits a channel, clamped to [0, 1]; 1, 3 or 4 channels. Throws Error(cannotWrite).
std::vector<std::uint8_t> encodePng16(const Image& image);

}  // namespace tg
