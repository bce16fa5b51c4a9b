// SPDX-License-Identifier: Apache-2.0
// One Gaussian in the place of two.
#pragma once
#include <cstddef>

#include "core/merge/moments.h"
#include "core/model/model.h"
#include "core/model/texture_fit.h"

namespace tg {

// A Gaussian of a pair: what it brings, and the part of its opacity that counts in the texture.
struct PairMember {
  std::size_t gaussian;
  GaussianMoments moments;
  double part = 1.0;
};

// Gaussian `a` becomes that of both moments, its SH by their masses; where one has a texture, both are resampled onto
// it, behind the texels that there are. `b` stays as it is, to be removed. The moments of both. Throws Error(badData)
// for more than kMaxModelTexels.
GaussianMoments mergePair(GaussianModel& model, const PairMember& a, const PairMember& b, AxisFits& fits);

}  // namespace tg
