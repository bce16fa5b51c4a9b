// SPDX-License-Identifier: Apache-2.0
// The backward pass of a picture, or of some rows of its tiles: sums a (tile, splat) pair, then a Gaussian's gradient
// from the sums of all its pairs, in the order of the tiles.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "render/cpu/project.h"
#include "render/cpu/tiles.h"
#include "training/cpu/backward.h"
#include "training/cpu/finish.h"
#include "training/step/gradient.h"

namespace tg::cpu {

// [pairs] each, by TileLists::pairs, where `shows` is 1; screen_abs is empty without statistics, texture_sums without
// textures.
struct PairBuffers {
  std::vector<std::uint8_t> shows;
  std::vector<PairSums> sums;
  std::vector<float> screen_abs;
  std::vector<PairTextureSums> texture_sums;
  TexelSlots slots;
};

// The sums of all pairs of the lists. Texels' gradients come in groups of tiles, as many at once as texels_in_flight
// allow: `gather` is called after each, while out.slots holds those of the group's pairs; never without textures.
void backwardPairs(const BackwardInput& input, std::size_t texels_in_flight, PairBuffers& out,
                   const std::function<void()>& gather);

// Sums is a row of floats.
template <typename Sums>
void addSums(const Sums& from, Sums& to) {
  static_assert(sizeof(Sums) % sizeof(float) == 0);
  const auto* a = reinterpret_cast<const float*>(&from);
  auto* b = reinterpret_cast<float*>(&to);
  for (std::size_t i = 0; i < sizeof(Sums) / sizeof(float); ++i) b[i] += a[i];
}
// Adds a pair that shows; `textured`: its splat is.
void addPair(const PairBuffers& pairs, std::uint32_t pair, bool textured, SplatSums& to);

// Adds the slots of a splat's pairs [first, end) to v_texels, the splat's first texel there. Returns which texels of
// the splat may have changed.
TexelSlots::Range addSlots(const TexelSlots& slots, std::uint32_t first, std::uint32_t end, glm::vec4* v_texels);

// Adds up a splat's pairs into `sums`. False: it shows nowhere, and `sums` is as it was.
using GatherSplat = std::function<bool(std::uint32_t splat, SplatSums& sums)>;
// The gradient of a whole model, the texels' part of which is there already: as it is without textures, all 0.
// gaussians: the splats' in `screen`; splat_of is scratch. `gather` is called from any thread.
void finishModel(const View& view, const GaussianModel& model, std::span<const std::uint32_t> gaussians,
                 const ScreenSplats& screen, const GatherSplat& gather, std::vector<std::uint32_t>& splat_of,
                 ModelGradient& gradient);

}  // namespace tg::cpu
