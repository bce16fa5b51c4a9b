// SPDX-License-Identifier: Apache-2.0
// The backward pixel loop: from dL/d(picture) to a few sums per (tile, splat) pair, from which all gradients follow.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "render/cpu/blend.h"
#include "render/cpu/project.h"
#include "render/cpu/tiles.h"
#include "training/step/gradient.h"

namespace tg::cpu {

// Sums over a tile's pixels. (x, y) = pixel - centre of the splat. With alpha = 2^(log2_opacity - q), q = |W|^2 / |D|^2
// and w the first triangular component of W, both scaled as in cpu::Splat,
//   a = alpha dL/d(alpha) / |D|^2,   b = a q - (v_u u + v_v v) / (|D|^2 ln 2),
// so that dL/d|W|^2 = -ln 2 a and dL/d|D|^2 = ln 2 b; v_u, v_v = dL/du, dL/dv. One cache line.
struct PairSums {
  float base[3];          // dL/d(base colour)
  float opacity;          // alpha dL/d(alpha) = opacity dL/d(opacity)
  float aw, aw_x, aw_y;   // a w {1, x, y}
  float a_y, a_xy, a_yy;  // a {y, x y, y^2}
  float b, b_x, b_y, b_xx, b_xy, b_yy;
};
// dL/d(numerator of u) and of v, by the same moments.
struct PairTextureSums {
  float u, u_x, u_y, u_xx, u_xy, u_yy;
  float v, v_x, v_y, v_xx, v_xy, v_yy;
};

// Where pairs leave the gradients of their texels: the splat's rectangle at texels[begin[pair]], in texel order. Only
// the rows that the pair's pixels touch are written and hold: a tile sees a few texels of a large texture.
struct TexelSlots {
  static constexpr std::size_t kNone = ~std::size_t{0};
  struct Range {
    std::uint32_t first, end;  // texels of the rectangle
  };
  std::vector<std::size_t> begin;  // [pairs] kNone: not of the tiles in work
  std::vector<Range> written;      // [pairs] where begin is not kNone
  std::vector<glm::vec4> texels;
};

// What backwardTiles() fills, all [pairs], by TileLists::pairs; entries of pairs that do not show are left as they are.
struct PairGradients {
  std::span<std::uint8_t> shows;  // zeros before; 1: the pair's other entries hold
  std::span<PairSums> sums;
  std::span<float> screen_abs;              // sum of |e| / ln 2 (docs/math.md 6.9); empty without statistics
  std::span<PairTextureSums> texture_sums;  // empty without textures
  TexelSlots& slots;
};

struct BackwardInput {
  const View& view;
  const ScreenSplats& screen;
  const TileLists& lists;
  const BlendRecord& record;
  const glm::vec4* texels;
  std::span<const glm::vec3> v_color;  // [as blendPicture's picture]
  GradientOptions options;
};
// For the pairs of tiles [first_tile, end_tile).
void backwardTiles(const BackwardInput& input, int first_tile, int end_tile, const PairGradients& out);

}  // namespace tg::cpu
