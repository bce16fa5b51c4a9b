// SPDX-License-Identifier: Apache-2.0
// LDR-FLIP: how different two pictures look when flipped between (Andersson et al., HPG 2020).
#pragma once
#include "core/image/image.h"
#include "core/image/metrics.h"

namespace tg {

// A 0.7 m wide monitor of 3840 pixels seen from 0.7 m: the paper's default. [pixels per degree of vision]
constexpr double kFlipPixelsPerDegree = 67.020643276582255;

// The error of every pixel, in [0, 1], 1 channel. Both images have 3 channels, sRGB; values are clamped to [0, 1].
Image flipMap(const Image& reference, const Image& test, double pixels_per_degree = kFlipPixelsPerDegree);
// Its mean over the pixels that count.
double flip(const Image& map, Mask mask = {});

}  // namespace tg
