// SPDX-License-Identifier: Apache-2.0
// Distances between images of one size.
#pragma once
#include <cstdint>
#include <span>

#include "core/image/image.h"

namespace tg {

// A mask is [height, width], 0: the pixel does not count; empty: all of them count. It must leave one at least.
using Mask = std::span<const std::uint8_t>;

// Peak signal-to-noise ratio [dB] of values clamped to [0,1], peak 1, over all channels; infinity when equal.
double psnr(const Image& a, const Image& b, Mask mask = {});
// The same after rounding both to 8 bit as encodePng() does (what papers report from PNG files).
double psnr8Bit(const Image& a, const Image& b, Mask mask = {});
// Mean SSIM over pixels and channels: 11x11 Gaussian window, sigma 1.5, zero padding, C1 = 1e-4, C2 = 9e-4
// (Wang et al. 2004 as in 3DGS). A masked pixel is as one beyond the border: zero in both images for the windows that
// overlap it, and without a window of its own.
double ssim(const Image& a, const Image& b, Mask mask = {});

}  // namespace tg
