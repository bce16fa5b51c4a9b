// SPDX-License-Identifier: Apache-2.0
// Blending in the order of each pixel's own hits (docs/math.md 5.1).
#pragma once
#include "render/cpu/blend.h"

namespace tg::cpu {

// Every 16 x 8 pixels sort their splats by the hits in their middle; every pixel keeps the last kOrderDepth of its own
// hits sorted and blends the nearest when another comes. A hit that is more than so many places from its place in the
// pixel's order is blended late: with 16, 32, 64 and 128 places docs/sample.tgz (camera 0) lies 34, 46, 53 and 63 dB
// from the full sort, at 12.0, 13.5, 14.2 and 13.7 ms of processor time (the global order: 28 dB, 5.8 ms).
constexpr int kOrderDepth = 128;

// As blendFrame, without overdraw. all: more than the picture and alpha is wanted.
void blendInOrder(const View& view, const ScreenSplats& screen, const TileLists& lists, Texels texels, bool all,
                  Frame& frame);

}  // namespace tg::cpu
