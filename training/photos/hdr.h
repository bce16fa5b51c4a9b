// SPDX-License-Identifier: Apache-2.0
// Pictures in HDR - PQ and HLG, BT.2100 - as those of a common screen.
#pragma once
#include "core/image/image.h"

namespace tg {

enum class Transfer { sdr, pq, hlg };

// BT.2408: what shows white on paper in HDR has this brightness, and becomes 1. [cd/m2]
constexpr double kPaperWhite = 203;
// Twice [linear] as bright and more is pressed below 1, up to this [cd/m2]: what HLG is graded for, and phones show.
constexpr double kBrightest = 1000;
// Below this [linear, 1 is paper white] nothing is changed; a Moebius curve goes on from there to kBrightest.
constexpr double kUnchanged = 0.5;

// Signals in [0, 1] of primaries as H.273 numbers them (9: BT.2020, 12: Display P3, others are taken for BT.709's),
// three channels, become BT.709's for a screen of gamma 2.4, in [0, 1]: ffmpeg's zscale and tonemap=mobius do so, too.
Image toneMapped(Image image, Transfer transfer, int primaries);

}  // namespace tg
