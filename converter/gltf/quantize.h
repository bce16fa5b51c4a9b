// SPDX-License-Identifier: Apache-2.0
// Atlas texels as integers: value = stored / largest * scale + offset, per channel; largest is 255 or 65535.
#pragma once
#include <array>
#include <cstdint>

#include "core/image/image.h"
#include "core/model/atlas.h"
#include "core/model/model.h"

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

// Texels that are coarser where they weigh less, of 8 bits in the file.
struct TexelSteps {
  double step = 0;              // between the colours that weigh most; alpha's are twice as wide
  std::array<double, 3> units;  // between stored numbers of a colour channel: step, or a power of 2 of it
};
// `step`: above 0. Units are as narrow as 127 of them reach the 99.9 percentile of a channel's magnitudes.
TexelSteps texelStepsOf(const TextureAtlas& atlas, double step);
// The textures of `model` with colours that are multiples of a unit, and alphas that are 1 less such; the unit is the
// step times the power of 2 nearest to the texel's spread (converter/formats/texel_spread.h), and at least what is
// stored. `base`: bakeFallback(model, FallbackScale::kept), whose opacities say how much a Gaussian weighs.
TextureAtlas texelsInSteps(const GaussianModel& model, const GaussianModel& base, const TexelSteps& steps);
// What a file of 8 bits holds of them: those that are further from neutral end where its numbers do.
TextureAtlas withinReach(TextureAtlas atlas, const TexelSteps& steps);
// Of what texelsInSteps made: 128 stands for 0 in colour, 255 for 1 in alpha.
QuantizedPage quantizePage(const Image& page, const TexelSteps& steps);

}  // namespace tg
