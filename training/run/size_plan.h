// SPDX-License-Identifier: Apache-2.0
// How many Gaussians and texels a file of some size has room for.
#pragma once
#include <cstddef>
#include <cstdint>

#include "training/settings/settings.h"

namespace tg {

// What training is to make so that a file of `bytes`, `part` times as many as a .sog takes, holds it with steps near
// 4, with which more Gaussians show more than finer steps would (docs/lab/quality.md, "Training for the file"): how
// many Gaussians, and with a texture mode how many texels each of them in the mean. From bytes a Gaussian and a texel
// as measured; the steps of the file make up for what another scene takes. Throws Error(usage) for fewer bytes than a
// hundred Gaussians need.
struct SizePlan {
  std::size_t gaussians = 0;
  double texels = 0;
};
constexpr int kPlannedShDegree = 1;
constexpr int kPlannedTextureSize = 8;  // [texels] a side, of which the fewer are taken
SizePlan planForSize(std::uint64_t bytes, double part, std::uint64_t training_pixels, int sh_degree, TextureMode mode);
// How many different textures of side x side texels Gaussians are to share in such a file; 0: none, as it is too small
// for them.
int planSharedTextures(std::uint64_t bytes, double part, int side);
// With so many different textures of side x side texels, which Gaussians share.
SizePlan planForDictionary(std::uint64_t bytes, double part, int sh_degree, int textures, int side);

}  // namespace tg
