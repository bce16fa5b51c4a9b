// SPDX-License-Identifier: Apache-2.0
// Per tile, splats back to front; per splat, columns of vectors; down a column x is fixed and y a scalar, so sums over
// rows of {1, y, y^2} suffice and take their powers of x once a column.
#include "training/cpu/backward.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "core/parallel.h"

// Structs hold vectors here, which the scalable targets forbid.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "training/cpu/backward.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "render/cpu/kernel-inl.h"
#include "render/cpu/texture-inl.h"

#ifndef TG_TRAINING_CPU_BACKWARD_ARGS
#define TG_TRAINING_CPU_BACKWARD_ARGS
namespace tg::cpu {
struct BackwardArgs {
  const BackwardInput& in;
  PairSums* sums;
  PairTextureSums* texture_sums;
  TexelSlots* slots;
};
}  // namespace tg::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {

// Pixel state of a tile, [column][row][lane].
struct GradientState {
  alignas(64) float transmittance[kTilePixels];  // behind the splats not yet visited
  alignas(64) float behind[kTilePixels];  // dL/d(picture) . colour that arrives from behind the splats not visited
  alignas(64) float v_color[3][kTilePixels];
  alignas(64) std::int32_t stop[kTilePixels];
  alignas(64) std::int32_t row_stop[kColumns][kTileHeight];  // highest stop of a vector
};

// Moments of one coefficient: per row while going down a column, then per splat.
struct Moments {
  V c, y, yy, x, xx, xy;
};
struct ColumnMoments {
  V c, y, yy;
};
HWY_INLINE Moments zeroMoments() {
  const V zero = hn::Zero(df);
  return {zero, zero, zero, zero, zero, zero};
}
HWY_INLINE ColumnMoments zeroColumn() {
  const V zero = hn::Zero(df);
  return {zero, zero, zero};
}
HWY_INLINE void add(ColumnMoments& m, V value, float y) {
  const V value_y = hn::Mul(value, set(y));
  m.c = hn::Add(m.c, value);
  m.y = hn::Add(m.y, value_y);
  m.yy = hn::MulAdd(value_y, set(y), m.yy);
}
HWY_INLINE void fold(Moments& m, const ColumnMoments& column, V x) {
  const V value_x = hn::Mul(column.c, x);
  m.c = hn::Add(m.c, column.c);
  m.y = hn::Add(m.y, column.y);
  m.yy = hn::Add(m.yy, column.yy);
  m.x = hn::Add(m.x, value_x);
  m.xx = hn::MulAdd(value_x, x, m.xx);
  m.xy = hn::MulAdd(column.y, x, m.xy);
}

HWY_INLINE float sum(V v) { return hn::GetLane(hn::SumOfLanes(df, v)); }

HWY_INLINE void store(const Moments& m, float* to) {
  to[0] = sum(m.c);
  to[1] = sum(m.x);
  to[2] = sum(m.y);
  to[3] = sum(m.xx);
  to[4] = sum(m.xy);
  to[5] = sum(m.yy);
}

// texel[0..3] += the lane sums of r, g, b, a.
HWY_INLINE void addLaneSums(V r, V g, V b, V a, float* texel) {
#if HWY_TARGET == HWY_SCALAR
  texel[0] += hn::GetLane(r);
  texel[1] += hn::GetLane(g);
  texel[2] += hn::GetLane(b);
  texel[3] += hn::GetLane(a);
#else
  // Within each block of four lanes: two interleaves and adds leave (r, g, b, a) sums.
  const hn::Repartition<std::uint64_t, Floats> d64;
  const V rg = hn::Add(hn::InterleaveLower(df, r, g), hn::InterleaveUpper(df, r, g));
  const V ba = hn::Add(hn::InterleaveLower(df, b, a), hn::InterleaveUpper(df, b, a));
  const V low = hn::BitCast(df, hn::InterleaveLower(d64, hn::BitCast(d64, rg), hn::BitCast(d64, ba)));
  const V high = hn::BitCast(df, hn::InterleaveUpper(d64, hn::BitCast(d64, rg), hn::BitCast(d64, ba)));
  const V blocks = hn::Add(low, high);
  const hn::FixedTag<float, 4> d4;
  auto total = hn::LoadU(d4, texel);
  alignas(64) float lanes[kLanes];
  hn::Store(blocks, df, lanes);
  for (int block = 0; block < kLanes; block += 4) total = hn::Add(total, hn::Load(d4, lanes + block));
  hn::StoreU(total, d4, texel);
#endif
}

// A texture at the blocks of a splat, as a loss sees it: "along" is dL/d(picture) . texture colour.
struct TextureBlocks {
  alignas(64) float gaussian[Blocks::kMax * kLanes];  // opacity * G, before the alpha factor
  alignas(64) float along[Blocks::kMax * kLanes];
  alignas(64) float along_u[Blocks::kMax * kLanes];  // d(along)/du [per sigma], and so on
  alignas(64) float along_v[Blocks::kMax * kLanes];
  alignas(64) float alpha_u[Blocks::kMax * kLanes];  // of the alpha factor
  alignas(64) float alpha_v[Blocks::kMax * kLanes];
  alignas(64) float u[Blocks::kMax * kLanes];
  alignas(64) float v[Blocks::kMax * kLanes];
  alignas(64) float fraction_u[Blocks::kMax * kLanes];
  alignas(64) float fraction_v[Blocks::kMax * kLanes];
  alignas(64) std::int32_t cell[Blocks::kMax * kLanes];
  alignas(64) float inside[Blocks::kMax * kLanes];  // 1 or 0
};

// Fills `texture_blocks`, multiplies the values of `blocks` by the alpha factor and drops what falls below the cut.
HWY_INLINE void applyTexture(const Texture& texture, const Splat& s, const View& view, const Rows& rows, int tile_x,
                             const GradientState& state, Blocks& blocks, TextureBlocks& out) {
  const V zero = hn::Zero(df);
  for (int column = 0; column < kColumns; ++column) {
    const V x = columnX(s, tile_x, column);
    for (int i = blocks.begin[column]; i < blocks.begin[column + 1]; ++i) {
      const int lane = i * kLanes;
      const V value = hn::Load(df, blocks.value + lane);
      const TexturePoint at = locate(texture, localRay(s, rows.y[blocks.row[i]], x),
                                     hn::Load(df, blocks.inverse_d2 + lane), hn::Gt(value, zero));
      V v_color[3];
      for (int ch = 0; ch < 3; ++ch) v_color[ch] = hn::Load(df, state.v_color[ch] + blocks.at[i]);
      V along[4] = {zero, zero, zero, zero};
      V alpha[4] = {zero, zero, zero, zero};
      forEachCell(at, [&](std::size_t cell, M lanes) HWY_ATTR {
        for (int k = 0; k < 4; ++k) {
          const float* texel = texture.texels + cell + cornerStep(texture, k);
          if (view.texture_rgb) {
            const V red = hn::Mul(v_color[0], set(texel[0]));
            const V red_green = hn::MulAdd(v_color[1], set(texel[1]), red);
            along[k] = hn::IfThenElse(lanes, hn::MulAdd(v_color[2], set(texel[2]), red_green), along[k]);
          }
          alpha[k] = hn::IfThenElse(lanes, set(texel[3]), alpha[k]);
        }
      });
      const Corners corners = cornerWeights(at);
      V value_along = zero, value_alpha = zero;
      for (int k = 0; k < 4; ++k) {
        value_along = hn::MulAdd(corners.weight[k], along[k], value_along);
        value_alpha = hn::MulAdd(corners.weight[k], hn::Sub(alpha[k], set(1.0f)), value_alpha);
      }
      const auto slope = [](V fraction, V low, V high, float scale)
                             HWY_ATTR { return hn::Mul(set(scale), hn::MulAdd(fraction, hn::Sub(high, low), low)); };
      hn::Store(value, df, out.gaussian + lane);
      hn::Store(value_along, df, out.along + lane);
      hn::Store(
          slope(at.fraction_v, hn::Sub(along[1], along[0]), hn::Sub(along[3], along[2]), texture.texels_per_sigma_u),
          df, out.along_u + lane);
      hn::Store(
          slope(at.fraction_u, hn::Sub(along[2], along[0]), hn::Sub(along[3], along[1]), texture.texels_per_sigma_v),
          df, out.along_v + lane);
      hn::Store(at.u, df, out.u + lane);
      hn::Store(at.v, df, out.v + lane);
      hn::Store(at.fraction_u, df, out.fraction_u + lane);
      hn::Store(at.fraction_v, df, out.fraction_v + lane);
      hn::Store(at.cell, di, out.cell + lane);
      hn::Store(hn::IfThenElseZero(at.inside, set(1.0f)), df, out.inside + lane);
      if (view.texture_alpha) {
        hn::Store(
            slope(at.fraction_v, hn::Sub(alpha[1], alpha[0]), hn::Sub(alpha[3], alpha[2]), texture.texels_per_sigma_u),
            df, out.alpha_u + lane);
        hn::Store(
            slope(at.fraction_u, hn::Sub(alpha[2], alpha[0]), hn::Sub(alpha[3], alpha[1]), texture.texels_per_sigma_v),
            df, out.alpha_v + lane);
        hn::Store(cutAlpha(hn::Mul(value, alphaFactor(at.inside, value_alpha))), df, blocks.value + lane);
      } else {
        hn::Store(zero, df, out.alpha_u + lane);
        hn::Store(zero, df, out.alpha_v + lane);
      }
    }
  }
}

// What the colour stage leaves for the geometry stages, per block.
struct ColorGradient {
  alignas(64) float v_power[Blocks::kMax * kLanes];
  alignas(64) float v_alpha[Blocks::kMax * kLanes];  // with a texture: 0 where alpha is clamped
  alignas(64) float weight[Blocks::kMax * kLanes];   // with a texture
};

// Steps 1 and 2: colour and alpha, the transmittance before the splat rebuilt from the one behind it.
template <bool kTexture>
HWY_INLINE void backwardColor(const Splat& s, const Blocks& blocks, const TextureBlocks& texture,
                              const GradientOptions& options, GradientState& state, ColorGradient& color,
                              PairSums& sums) {
  const V zero = hn::Zero(df);
  V red = zero, green = zero, blue = zero, power = zero;
  for (int i = 0; i < blocks.count(); ++i) {
    const int at = blocks.at[i];
    const int lane = i * kLanes;
    const V alpha_raw = hn::Load(df, blocks.value + lane);
    const V alpha = hn::Min(alpha_raw, set(kAlphaMax));
    const V inverse = hn::Div(set(1.0f), hn::Sub(set(1.0f), alpha));
    const V before = hn::Mul(hn::Load(df, state.transmittance + at), inverse);
    const V weight = hn::Mul(before, alpha);
    const V v_red = hn::Load(df, state.v_color[0] + at);
    const V v_green = hn::Load(df, state.v_color[1] + at);
    const V v_blue = hn::Load(df, state.v_color[2] + at);
    V along = hn::Mul(v_red, set(s.base.x));
    along = hn::MulAdd(v_green, set(s.base.y), along);
    along = hn::MulAdd(v_blue, set(s.base.z), along);
    V along_behind = along;  // as splats before this one see it
    if constexpr (kTexture) {
      along = hn::Add(along, hn::Load(df, texture.along + lane));
      if (options.texture_in_suffix) along_behind = along;
    }
    const V behind = hn::Load(df, state.behind + at);
    V v_alpha = hn::MulSub(before, along, hn::Mul(behind, inverse));
    hn::Store(hn::MulAdd(weight, along_behind, behind), df, state.behind + at);
    hn::Store(before, df, state.transmittance + at);
    red = hn::MulAdd(weight, v_red, red);
    green = hn::MulAdd(weight, v_green, green);
    blue = hn::MulAdd(weight, v_blue, blue);
    v_alpha = hn::IfThenElseZero(hn::Lt(alpha_raw, set(kAlphaMax)), v_alpha);  // nothing flows through a clamped alpha
    const V v_power = hn::Mul(hn::Mul(v_alpha, alpha_raw), set(-0.5f));
    power = hn::Add(power, v_power);
    hn::Store(v_power, df, color.v_power + lane);
    if constexpr (kTexture) {
      const V shows = hn::IfThenElseZero(hn::Gt(alpha_raw, zero), v_alpha);
      hn::Store(shows, df, color.v_alpha + lane);
      hn::Store(weight, df, color.weight + lane);
    }
  }
  sums.base[0] = sum(red);
  sums.base[1] = sum(green);
  sums.base[2] = sum(blue);
  sums.power = sum(power);
}

// Step 4 for u and v: gradients of their numerators, their share of dL/d|D|^2, and of e.
struct NumeratorGradient {
  V u, v;
  V b;
  V e_x, e_y;  // per pixel of the projected mean, without e's sign
};
HWY_INLINE NumeratorGradient numeratorGradient(const Splat& s, float y, V x, V inverse_d2, int lane,
                                               const TextureBlocks& texture, const ColorGradient& color) {
  const V weight = hn::Load(df, color.weight + lane);
  const V v_sample = hn::Mul(hn::Load(df, color.v_alpha + lane), hn::Load(df, texture.gaussian + lane));
  const V scale = hn::Mul(inverse_d2, hn::Load(df, texture.inside + lane));
  NumeratorGradient g;
  g.u = hn::Mul(scale, hn::MulAdd(weight, hn::Load(df, texture.along_u + lane),
                                  hn::Mul(v_sample, hn::Load(df, texture.alpha_u + lane))));
  g.v = hn::Mul(scale, hn::MulAdd(weight, hn::Load(df, texture.along_v + lane),
                                  hn::Mul(v_sample, hn::Load(df, texture.alpha_v + lane))));
  g.b = hn::MulAdd(g.u, hn::Load(df, texture.u + lane), hn::Mul(g.v, hn::Load(df, texture.v + lane)));
  // Moving the projected mean changes the numerators by -D x (wx + kappa y) and -D x (wy - kappa x).
  const LocalRay ray = localRay(s, y, x);
  const V xa = set(s.wx.x + s.kappa.x * y);
  const V xb = set(s.wx.y + s.kappa.y * y);
  const V xc = set(s.wx.z + s.kappa.z * y);
  const V ya = hn::NegMulAdd(set(s.kappa.x), x, set(s.wy.x));
  const V yb = hn::NegMulAdd(set(s.kappa.y), x, set(s.wy.y));
  const V yc = hn::NegMulAdd(set(s.kappa.z), x, set(s.wy.z));
  g.e_x = hn::MulAdd(g.u, hn::MulSub(ray.d_b, xc, hn::Mul(ray.d_c, xb)),
                     hn::Mul(g.v, hn::MulSub(ray.d_c, xa, hn::Mul(ray.d_a, xc))));
  g.e_y = hn::MulAdd(g.u, hn::MulSub(ray.d_b, yc, hn::Mul(ray.d_c, yb)),
                     hn::Mul(g.v, hn::MulSub(ray.d_c, ya, hn::Mul(ray.d_a, yc))));
  return g;
}

// Steps 5 and 6: moments of dL/d|W|^2, dL/d|D|^2 and of the numerators' gradients, and |e|.
template <bool kTexture, bool kStatistics>
HWY_INLINE void backwardGeometry(const BackwardInput& in, const Splat& s, const Rows& rows, int tile_x,
                                 const Blocks& blocks, const TextureBlocks& texture, const ColorGradient& color,
                                 PairSums& sums, PairTextureSums* texture_sums) {
  const V zero = hn::Zero(df);
  const auto size_x = static_cast<float>(in.view.width);  // NDC: half of it times the 2 of the square's derivative
  const auto size_y = static_cast<float>(in.view.height);
  const V e_x_w = set(size_x * s.w_xx);
  const V e_y_w = set(size_y * s.w_xy);
  const V kappa_first = set(s.kappa_first);
  Moments of_b = zeroMoments(), of_u = zeroMoments(), of_v = zeroMoments();
  V sum_aw = zero, sum_aw_x = zero, sum_aw_y = zero, sum_a_y = zero, sum_a_xy = zero, sum_a_yy = zero;
  V sum_abs = zero;
  for (int column = 0; column < kColumns; ++column) {
    if (blocks.begin[column] == blocks.begin[column + 1]) continue;
    const V x = columnX(s, tile_x, column);
    const V e_y_kappa = hn::Mul(x, set(size_y));
    ColumnMoments column_b = zeroColumn(), column_u = zeroColumn(), column_v = zeroColumn();
    V aw = zero, aw_y = zero, a_y = zero, a_yy = zero;
    for (int i = blocks.begin[column]; i < blocks.begin[column + 1]; ++i) {
      const int lane = i * kLanes;
      const float y = rows.y[blocks.row[i]];
      const V w = hn::Load(df, blocks.w + lane);
      const V inverse_d2 = hn::Load(df, blocks.inverse_d2 + lane);
      const V a = hn::Mul(hn::Load(df, color.v_power + lane), inverse_d2);
      V b = hn::NegMulAdd(a, hn::Load(df, blocks.power + lane), zero);
      const V a_w = hn::Mul(a, w);
      const V ay = hn::Mul(a, set(y));
      aw = hn::Add(aw, a_w);
      aw_y = hn::MulAdd(a_w, set(y), aw_y);
      a_y = hn::Add(a_y, ay);
      a_yy = hn::MulAdd(ay, set(y), a_yy);
      // e: d|W|^2 = -2 W . (wx + kappa y) and -2 W . (wy - kappa x) per pixel of the projected mean.
      const V w_kappa = hn::MulAdd(kappa_first, w, set(s.kappa_second * y));
      V e_x = hn::MulAdd(w_kappa, set(size_x * y), hn::Mul(e_x_w, w));
      V e_y = hn::NegMulAdd(w_kappa, e_y_kappa, hn::MulAdd(e_y_w, w, set(size_y * s.w_yy * s.w_yy * y)));
      if constexpr (kTexture) {
        const NumeratorGradient g = numeratorGradient(s, y, x, inverse_d2, lane, texture, color);
        b = hn::Sub(b, g.b);
        add(column_u, g.u, y);
        add(column_v, g.v, y);
        e_x = hn::MulAdd(e_x, a, hn::Mul(g.e_x, set(0.5f * size_x)));
        e_y = hn::MulAdd(e_y, a, hn::Mul(g.e_y, set(0.5f * size_y)));
        if (kStatistics) sum_abs = hn::Add(sum_abs, hn::Sqrt(hn::MulAdd(e_x, e_x, hn::Mul(e_y, e_y))));
      } else if constexpr (kStatistics) {
        sum_abs = hn::MulAdd(hn::Abs(a), hn::Sqrt(hn::MulAdd(e_x, e_x, hn::Mul(e_y, e_y))), sum_abs);
      }
      add(column_b, b, y);
    }
    sum_aw = hn::Add(sum_aw, aw);
    sum_aw_x = hn::MulAdd(aw, x, sum_aw_x);
    sum_aw_y = hn::Add(sum_aw_y, aw_y);
    sum_a_y = hn::Add(sum_a_y, a_y);
    sum_a_xy = hn::MulAdd(a_y, x, sum_a_xy);
    sum_a_yy = hn::Add(sum_a_yy, a_yy);
    fold(of_b, column_b, x);
    if constexpr (kTexture) {
      fold(of_u, column_u, x);
      fold(of_v, column_v, x);
    }
  }
  sums.aw = sum(sum_aw);
  sums.aw_x = sum(sum_aw_x);
  sums.aw_y = sum(sum_aw_y);
  sums.a_y = sum(sum_a_y);
  sums.a_xy = sum(sum_a_xy);
  sums.a_yy = sum(sum_a_yy);
  store(of_b, &sums.b);
  sums.screen_abs = sum(sum_abs);
  if constexpr (kTexture) {
    store(of_u, &texture_sums->u);
    store(of_v, &texture_sums->v);
  }
}

// Step 3: the gradients of the texels, into the pair's slot.
HWY_INLINE void backwardTexels(const View& view, const Texture& texture, const Blocks& blocks,
                               const TextureBlocks& texture_blocks, const ColorGradient& color,
                               const GradientState& state, float* slot) {
  for (int i = 0; i < blocks.count(); ++i) {
    const int lane = i * kLanes;
    TexturePoint at;
    at.inside = hn::Gt(hn::Load(df, texture_blocks.inside + lane), hn::Zero(df));
    at.fraction_u = hn::Load(df, texture_blocks.fraction_u + lane);
    at.fraction_v = hn::Load(df, texture_blocks.fraction_v + lane);
    at.cell = hn::Load(di, texture_blocks.cell + lane);
    const Corners corners = cornerWeights(at);
    const V weight = view.texture_rgb ? hn::Load(df, color.weight + lane) : hn::Zero(df);
    V v_rgb[3];
    for (int ch = 0; ch < 3; ++ch) v_rgb[ch] = hn::Mul(weight, hn::Load(df, state.v_color[ch] + blocks.at[i]));
    const V v_a = view.texture_alpha
                      ? hn::Mul(hn::Load(df, color.v_alpha + lane), hn::Load(df, texture_blocks.gaussian + lane))
                      : hn::Zero(df);
    forEachCell(at, [&](std::size_t cell, M lanes) HWY_ATTR {
      for (int k = 0; k < 4; ++k) {
        const V w = hn::IfThenElseZero(lanes, corners.weight[k]);
        addLaneSums(hn::Mul(w, v_rgb[0]), hn::Mul(w, v_rgb[1]), hn::Mul(w, v_rgb[2]), hn::Mul(w, v_a),
                    slot + cell + cornerStep(texture, k));
      }
    });
  }
}

// Bit r: some pixel of row r of this column blended the splat at `position` or one behind it.
HWY_INLINE std::uint32_t openRows(const GradientState& state, int column, std::int32_t position) {
  std::uint32_t bits = 0;
  for (int row = 0; row < kTileHeight; row += kLanes) {
    const auto later = hn::Gt(hn::Load(di, state.row_stop[column] + row), hn::Set(di, position));
    bits |= bitsOf(hn::RebindMask(df, later)) << row;
  }
  return bits;
}

// The pair's texel gradients, zeroed.
HWY_INLINE float* openSlot(TexelSlots& slots, const Splat& s, std::uint32_t pair) {
  const std::size_t index = pair - slots.first;
  glm::vec4* slot = slots.texels.data() + slots.begin[index];
  std::fill_n(slot, std::size_t{s.texture_width} * s.texture_height, glm::vec4(0.0f));
  slots.used[index] = 1;
  return &slot->x;
}

template <bool kStatistics>
void backwardTile(const BackwardArgs& args, int tile) {
  const BackwardInput& in = args.in;
  const int tile_x = tile % in.lists.tiles_x * kTileWidth;
  const int tile_y = tile / in.lists.tiles_x * kTileHeight;
  const int width = std::min(kTileWidth, in.view.width - tile_x);
  const int height = std::min(kTileHeight, in.view.height - tile_y);
  const std::span<const std::uint32_t> list = in.lists.list(tile);
  const std::uint32_t first_pair = in.lists.begin[tile];

  GradientState state;
  std::memset(&state, 0, sizeof(state));
  std::int32_t end = 0;
  for (int row = 0; row < height; ++row) {
    for (int x = 0; x < width; ++x) {
      const int at = offsetOf(x / kLanes, row) + x % kLanes;
      const std::size_t recorded = static_cast<std::size_t>(tile) * kTilePixels + row * kTileWidth + x;
      const glm::vec3 v_color = in.v_color[static_cast<std::size_t>(tile_y + row) * in.view.width + tile_x + x];
      const std::int32_t stop = in.record.stop[recorded];
      state.transmittance[at] = in.record.transmittance[recorded];
      state.behind[at] = in.record.transmittance[recorded] * glm::dot(v_color, in.view.background);
      for (int ch = 0; ch < 3; ++ch) state.v_color[ch][at] = v_color[ch];
      state.stop[at] = stop;
      state.row_stop[x / kLanes][row] = std::max(state.row_stop[x / kLanes][row], stop);
      end = std::max(end, stop);
    }
  }
  Rows rows;
  Blocks blocks;
  TextureBlocks texture_blocks;
  ColorGradient color;
  for (auto position = static_cast<std::int32_t>(list.size()) - 1; position >= 0; --position) {
    const Splat& s = in.screen.splats[list[position]];
    if (position > 1) {
      prefetchSplat(in.screen.splats[list[position - 2]]);
      prefetchTexels(in.screen.splats[list[position - 1]], in.texels);
    }
    const std::uint32_t pair = first_pair + static_cast<std::uint32_t>(position);
    PairSums& sums = args.sums[pair];
    PairTextureSums* texture_sums = in.view.textured() ? &args.texture_sums[pair] : nullptr;
    sums = {};
    if (texture_sums != nullptr) *texture_sums = {};
    if (position >= end || !prepareRows(s, tile_x, tile_y, rows)) continue;
    for (int column = 0; column < kColumns; ++column) rows.active[column] &= openRows(state, column, position);
    const auto open = [&](int at) HWY_ATTR {
      return hn::RebindMask(df, hn::Gt(hn::Load(di, state.stop + at), hn::Set(di, position)));
    };
    evaluateBlocks(s, rows, tile_x, open, blocks);
    if (blocks.count() == 0) continue;
    if (s.texture_width > 0) {
      const Texture texture = makeTexture(s, in.texels);
      applyTexture(texture, s, in.view, rows, tile_x, state, blocks, texture_blocks);
      backwardColor<true>(s, blocks, texture_blocks, in.options, state, color, sums);
      if (in.options.texture_to_geometry) {
        backwardGeometry<true, kStatistics>(in, s, rows, tile_x, blocks, texture_blocks, color, sums, texture_sums);
      } else {
        backwardGeometry<false, kStatistics>(in, s, rows, tile_x, blocks, texture_blocks, color, sums, nullptr);
      }
      backwardTexels(in.view, texture, blocks, texture_blocks, color, state, openSlot(*args.slots, s, pair));
    } else {
      backwardColor<false>(s, blocks, texture_blocks, in.options, state, color, sums);
      backwardGeometry<false, kStatistics>(in, s, rows, tile_x, blocks, texture_blocks, color, sums, nullptr);
    }
  }
}

void backwardTileAll(const BackwardArgs& args, int tile) { backwardTile<true>(args, tile); }
void backwardTileGradient(const BackwardArgs& args, int tile) { backwardTile<false>(args, tile); }

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
HWY_EXPORT(backwardTileAll);
HWY_EXPORT(backwardTileGradient);

void backwardTiles(const BackwardInput& input, int first_tile, int end_tile, std::span<PairSums> sums,
                   std::span<PairTextureSums> texture_sums, TexelSlots& slots) {
  const BackwardArgs args{input, sums.data(), texture_sums.data(), &slots};
  parallelFor(end_tile - first_tile, 1, [&](std::int64_t i) {
    const int tile = first_tile + static_cast<int>(i);
    if (input.options.statistics) {
      HWY_DYNAMIC_DISPATCH(backwardTileAll)(args, tile);
    } else {
      HWY_DYNAMIC_DISPATCH(backwardTileGradient)(args, tile);
    }
  });
}

}  // namespace tg::cpu
#endif
