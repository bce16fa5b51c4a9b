// SPDX-License-Identifier: Apache-2.0
// Per tile, splats back to front; per splat, columns of vectors; down a column x is fixed and y a scalar, so sums over
// rows of {1, y, y^2} suffice and take their powers of x once a column.
#include "training/cpu/backward.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

#include "core/system/assert.h"
#include "core/system/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "training/cpu/backward.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "render/cpu/kernel-inl.h"
#include "render/cpu/texture_cells-inl.h"

#ifndef TG_TRAINING_CPU_BACKWARD_ARGS
#define TG_TRAINING_CPU_BACKWARD_ARGS
namespace tg::cpu {
struct BackwardArgs {
  const BackwardInput& in;
  std::uint8_t* shows;
  PairSums* sums;
  float* screen_abs;
  PairTextureSums* texture_sums;
  TexelSlots* slots;
};
}  // namespace tg::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {
namespace {

constexpr float kInverseLn2 = 1.44269504f;

// Pixel state of a block.
struct GradientBlock {
  alignas(4 * kLanes) float transmittance[kLanes];  // behind the splats not yet visited
  float behind[kLanes];  // dL/d(picture) . colour that arrives from behind the splats not yet visited
  float v_color[3][kLanes];
  std::int32_t stop[kLanes];
};
struct GradientState {
  alignas(64) GradientBlock blocks[kBlocks];
};

// Moments of one coefficient: per row while going down a column, then per splat.
struct Moments {
  V c, x, y, xx, xy, yy;
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
HWY_INLINE void add(ColumnMoments& m, V value, V y) {
  const V value_y = hn::Mul(value, y);
  m.c = hn::Add(m.c, value);
  m.y = hn::Add(m.y, value_y);
  m.yy = hn::MulAdd(value_y, y, m.yy);
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

// The lane sums of a, b, c, d.
#if HWY_TARGET != HWY_SCALAR
using Four = hn::FixedTag<float, 4>;
HWY_INLINE hn::Vec<Four> laneSums(V a, V b, V c, V d) {
  // Within each part of four lanes: two interleaves and adds leave (a, b, c, d) sums.
  const hn::Repartition<std::uint64_t, Floats> d64;
  const V ab = hn::Add(hn::InterleaveLower(df, a, b), hn::InterleaveUpper(df, a, b));
  const V cd = hn::Add(hn::InterleaveLower(df, c, d), hn::InterleaveUpper(df, c, d));
  const V low = hn::BitCast(df, hn::InterleaveLower(d64, hn::BitCast(d64, ab), hn::BitCast(d64, cd)));
  const V high = hn::BitCast(df, hn::InterleaveUpper(d64, hn::BitCast(d64, ab), hn::BitCast(d64, cd)));
  const V parts = hn::Add(low, high);
#if HWY_TARGET == HWY_AVX2
  return hn::Add(hn::LowerHalf(Four(), parts), hn::UpperHalf(Four(), parts));
#else
  alignas(64) float lanes[kLanes];
  hn::Store(parts, df, lanes);
  auto total = hn::Load(Four(), lanes);
  for (int part = 4; part < kLanes; part += 4) total = hn::Add(total, hn::Load(Four(), lanes + part));
  return total;
#endif
}
#endif
HWY_INLINE void storeSums(V a, V b, V c, V d, float* to) {
#if HWY_TARGET == HWY_SCALAR
  to[0] = hn::GetLane(a);
  to[1] = hn::GetLane(b);
  to[2] = hn::GetLane(c);
  to[3] = hn::GetLane(d);
#else
  hn::StoreU(laneSums(a, b, c, d), Four(), to);
#endif
}
HWY_INLINE void addSums(V a, V b, V c, V d, float* to) {
#if HWY_TARGET == HWY_SCALAR
  to[0] += hn::GetLane(a);
  to[1] += hn::GetLane(b);
  to[2] += hn::GetLane(c);
  to[3] += hn::GetLane(d);
#else
  hn::StoreU(hn::Add(hn::LoadU(Four(), to), laneSums(a, b, c, d)), Four(), to);
#endif
}

// What a texture leaves to the later stages.
struct TextureSample {
  alignas(4 * kLanes) float v_u[kLanes];  // dL/d(numerator of u) [per texel]
  float v_v[kLanes];
  float v_factor[kLanes];  // dL/d(alpha factor), 0 where alpha is clamped
  float weight[kLanes];
};
struct TextureSamples {
  alignas(64) TextureSample at[kBlocks];
  CellSamples cells;              // of textures that are not small: cell is a texel or kOutside, and no lists
  CellCoefficients coefficients;  // of small textures
  alignas(64) float sums[kCells][4][4][kLanes];  // [cell, coefficient, channel]: dL/d(coefficient) of small textures

  TextureSamples() { clear(coefficients); }
};
constexpr std::uint32_t kOutside = ~0u;

// A texture at a sample, as a loss sees it: "along" is dL/d(picture) . texture colour.
struct TextureLook {
  V along;
  V along_u, along_v;  // d(along)/du [per texel], and so on
  V alpha;             // opacity * G times the alpha factor, 0 below the cut
  V alpha_u, alpha_v;  // of the alpha factor
};

// Steps 1 and 2: colour and alpha, the transmittance before the splat rebuilt from the one behind it. Leaves
// a = alpha dL/d(alpha) / |D|^2 in the place of the value.
struct ColorPass {
  const V base[3];
  const bool texture_in_suffix;
  V red = hn::Zero(df), green = hn::Zero(df), blue = hn::Zero(df), power = hn::Zero(df);

  HWY_INLINE ColorPass(const Splat& s, bool in_suffix)
      : base{set(s.base.x), set(s.base.y), set(s.base.z)}, texture_in_suffix(in_suffix) {}

  template <bool kTexture>
  HWY_INLINE void visit(const TextureLook* look, Sample& sample, GradientBlock& pixels, TextureSample* texture) {
    const V value = hn::Load(df, sample.value);
    const V alpha_raw = kTexture ? look->alpha : value;
    const V alpha = hn::Min(alpha_raw, set(kAlphaMax));
    const V inverse = hn::Div(set(1.0f), hn::Sub(set(1.0f), alpha));
    const V ratio = hn::Mul(alpha, inverse);
    const V transmittance = hn::Load(df, pixels.transmittance);
    const V weight = hn::Mul(transmittance, ratio);
    const V v_red = hn::Load(df, pixels.v_color[0]);
    const V v_green = hn::Load(df, pixels.v_color[1]);
    const V v_blue = hn::Load(df, pixels.v_color[2]);
    V along = hn::MulAdd(v_blue, base[2], hn::MulAdd(v_green, base[1], hn::Mul(v_red, base[0])));
    V along_behind = along;  // as splats before this one see it
    if constexpr (kTexture) {
      along = hn::Add(along, look->along);
      if (texture_in_suffix) along_behind = along;
    }
    const V behind = hn::Load(df, pixels.behind);
    // T_i along - behind / (1 - alpha), where T_i = transmittance / (1 - alpha).
    const V rise = hn::MulSub(transmittance, along, behind);
    hn::Store(hn::MulAdd(weight, along_behind, behind), df, pixels.behind);
    hn::Store(hn::Add(transmittance, weight), df, pixels.transmittance);
    red = hn::MulAdd(weight, v_red, red);
    green = hn::MulAdd(weight, v_green, green);
    blue = hn::MulAdd(weight, v_blue, blue);
    const M free = hn::Lt(alpha_raw, set(kAlphaMax));  // nothing flows through a clamped alpha
    const V v_power = hn::IfThenElseZero(free, hn::Mul(ratio, rise));
    const V inverse_d2 = hn::Load(df, sample.inverse_d2);
    power = hn::Add(power, v_power);
    hn::Store(hn::Mul(v_power, inverse_d2), df, sample.value);
    if constexpr (kTexture) {
      const M shows = hn::And(free, hn::Gt(alpha_raw, hn::Zero(df)));
      const V v_factor = hn::IfThenElseZero(shows, hn::Mul(hn::Mul(inverse, rise), value));
      const auto numerator = [&](V of_color, V of_alpha) HWY_ATTR {
        return hn::Mul(inverse_d2, hn::MulAdd(weight, of_color, hn::Mul(v_factor, of_alpha)));
      };
      hn::Store(numerator(look->along_u, look->alpha_u), df, texture->v_u);
      hn::Store(numerator(look->along_v, look->alpha_v), df, texture->v_v);
      hn::Store(v_factor, df, texture->v_factor);
      hn::Store(weight, df, texture->weight);
    }
  }
  HWY_INLINE void store(PairSums& sums) const { storeSums(red, green, blue, power, sums.base); }
};

// From a texture's coefficients [1, u, v, uv] in the cells of a sample.
HWY_INLINE TextureLook lookAt(const V* along, const V* alpha, const CellSample& at, V value) {
  const V u = hn::Load(df, at.fraction_u), v = hn::Load(df, at.fraction_v);
  TextureLook look;
  look.along_v = hn::MulAdd(u, along[3], along[2]);
  look.alpha_v = hn::MulAdd(u, alpha[3], alpha[2]);
  look.along = hn::MulAdd(v, look.along_v, hn::MulAdd(u, along[1], along[0]));
  const V deviation = hn::MulAdd(v, look.alpha_v, hn::MulAdd(u, alpha[1], alpha[0]));
  look.along_u = hn::MulAdd(v, along[3], along[1]);
  look.alpha_u = hn::MulAdd(v, alpha[3], alpha[1]);
  look.alpha = cutAlpha(hn::Mul(value, hn::Add(deviation, set(1.0f))));
  return look;
}

// The colour stage of a splat with a small texture.
HWY_INLINE void colorSmall(const Texture& texture, const Splat& s, const View& view, int tile_x, int tile_y,
                           ColorPass& pass, GradientState& state, Samples& samples, TextureSamples& texture_samples) {
  TileRays rays;
  fillRays(s, s, tile_x, tile_y, rowRange(s, tile_y), rays);
  CellSamples& cells = texture_samples.cells;
  locateCells<true>(texture, rays, samples, cells);
  CellCoefficients& coefficients = texture_samples.coefficients;
  fillCells(texture, cells.touched, view.texture_rgb, view.texture_alpha, coefficients);
  const auto along = [&](const float* c, const GradientBlock& pixels) HWY_ATTR {
    const V red = hn::Mul(hn::Load(df, pixels.v_color[0]), set(c[0]));
    const V red_green = hn::MulAdd(hn::Load(df, pixels.v_color[1]), set(c[1]), red);
    return hn::MulAdd(hn::Load(df, pixels.v_color[2]), set(c[2]), red_green);
  };
  const auto visit = [&](int i, const V* of_along, const V* of_alpha) HWY_ATTR {
    Sample& sample = samples.at[i];
    const TextureLook look = lookAt(of_along, of_alpha, cells.at[i], hn::Load(df, sample.value));
    pass.visit<true>(&look, sample, state.blocks[samples.block[i]], &texture_samples.at[i]);
  };
  for (int k = 0; k < cells.uniform_count; ++k) {
    const int i = cells.uniform[k];
    const auto& c = coefficients.at[cells.uniform_cell[k]];
    const GradientBlock& pixels = state.blocks[samples.block[i]];
    const V of_along[4] = {along(c[0], pixels), along(c[1], pixels), along(c[2], pixels), along(c[3], pixels)};
    const V of_alpha[4] = {set(c[0][3]), set(c[1][3]), set(c[2][3]), set(c[3][3])};
    visit(i, of_along, of_alpha);
  }
  for (int k = 0; k < cells.mixed_count; ++k) {
    const int i = cells.mixed[k];
    const GradientBlock& pixels = state.blocks[samples.block[i]];
    const V zero = hn::Zero(df);
    V of_along[4] = {zero, zero, zero, zero}, of_alpha[4] = {zero, zero, zero, zero};
    forEachCell(cells.at[i], cells.lanes[i], [&](int cell, M lanes) HWY_ATTR {
      for (int j = 0; j < 4; ++j) {
        const float* c = coefficients.at[cell][j];
        of_along[j] = hn::IfThenElse(lanes, along(c, pixels), of_along[j]);
        of_alpha[j] = hn::IfThenElse(lanes, set(c[3]), of_alpha[j]);
      }
    });
    visit(i, of_along, of_alpha);
  }
}

// Of a splat with any other texture.
HWY_INLINE void colorTextured(const Texture& texture, const Splat& s, const View& view, const Rows& rows, int tile_x,
                              ColorPass& pass, GradientState& state, Samples& samples,
                              TextureSamples& texture_samples) {
  const V zero = hn::Zero(df);
  for (int i = 0; i < samples.count; ++i) {
    Sample& sample = samples.at[i];
    GradientBlock& pixels = state.blocks[samples.block[i]];
    CellSample& out_cell = texture_samples.cells.at[i];
    const V x = columnX(s, tile_x, samples.block[i] / kTileHeight);
    const V value = hn::Load(df, sample.value);
    const TexturePoint at =
        locate(texture, localRay(s, rows.y[samples.row(i)], x), hn::Load(df, sample.inverse_d2), hn::Gt(value, zero));
    V v_color[3];
    for (int ch = 0; ch < 3; ++ch) v_color[ch] = hn::Load(df, pixels.v_color[ch]);
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
    const auto slope = [](V fraction, V low, V high) HWY_ATTR { return hn::MulAdd(fraction, hn::Sub(high, low), low); };
    TextureLook look;
    look.along = value_along;
    look.along_u = slope(at.fraction_v, hn::Sub(along[1], along[0]), hn::Sub(along[3], along[2]));
    look.along_v = slope(at.fraction_u, hn::Sub(along[2], along[0]), hn::Sub(along[3], along[1]));
    look.alpha = value;
    look.alpha_u = look.alpha_v = zero;
    if (view.texture_alpha) {
      look.alpha = cutAlpha(hn::Mul(value, alphaFactor(at.inside, value_alpha)));
      look.alpha_u = slope(at.fraction_v, hn::Sub(alpha[1], alpha[0]), hn::Sub(alpha[3], alpha[2]));
      look.alpha_v = slope(at.fraction_u, hn::Sub(alpha[2], alpha[0]), hn::Sub(alpha[3], alpha[1]));
    }
    hn::Store(hn::IfThenElseZero(at.inside, hn::Mul(at.u, set(texture.texels_per_sigma_u))), df, out_cell.u);
    hn::Store(hn::IfThenElseZero(at.inside, hn::Mul(at.v, set(texture.texels_per_sigma_v))), df, out_cell.v);
    hn::Store(at.fraction_u, df, out_cell.fraction_u);
    hn::Store(at.fraction_v, df, out_cell.fraction_v);
    const VI cell =
        hn::IfThenElse(hn::RebindMask(di, at.inside), at.cell, hn::Set(di, static_cast<std::int32_t>(kOutside)));
    hn::Store(hn::BitCast(du, cell), du, out_cell.cell);
    pass.visit<true>(&look, sample, pixels, &texture_samples.at[i]);
  }
}

// Gradient of e by the numerators of u and v, per pixel of the projected mean, without e's sign. v_u, v_v: of the
// numerators.
struct NumeratorShift {
  V e_x, e_y;
};
HWY_INLINE NumeratorShift numeratorShift(const Splat& s, float y, V x, V v_u, V v_v) {
  // Moving the projected mean changes the numerators by -D x (wx + kappa y) and -D x (wy - kappa x).
  const LocalRay ray = localRay(s, y, x);
  const V xa = set(s.wx.x + s.kappa.x * y);
  const V xb = set(s.wx.y + s.kappa.y * y);
  const V xc = set(s.wx.z + s.kappa.z * y);
  const V ya = hn::NegMulAdd(set(s.kappa.x), x, set(s.wy.x));
  const V yb = hn::NegMulAdd(set(s.kappa.y), x, set(s.wy.y));
  const V yc = hn::NegMulAdd(set(s.kappa.z), x, set(s.wy.z));
  return {hn::MulAdd(v_u, hn::MulSub(ray.d_b, xc, hn::Mul(ray.d_c, xb)),
                     hn::Mul(v_v, hn::MulSub(ray.d_c, xa, hn::Mul(ray.d_a, xc)))),
          hn::MulAdd(v_u, hn::MulSub(ray.d_b, yc, hn::Mul(ray.d_c, yb)),
                     hn::Mul(v_v, hn::MulSub(ray.d_c, ya, hn::Mul(ray.d_a, yc))))};
}

// Steps 5 and 6: moments of dL/d|W|^2, dL/d|D|^2 and of the numerators' gradients, and |e|.
template <bool kTexture, bool kStatistics>
HWY_INLINE void backwardGeometry(const View& view, const Splat& s, const Rows& rows, int tile_x, const Samples& samples,
                                 const TextureSamples& texture, PairSums& sums, float* screen_abs,
                                 PairTextureSums* texture_sums) {
  const V zero = hn::Zero(df);
  // e_y in units of e_x: NDC are pixels over half the image.
  const auto size_y = static_cast<float>(view.size.y);
  const V aspect = set(static_cast<float>(view.size.x) / size_y);
  Moments of_b = zeroMoments(), of_u = zeroMoments(), of_v = zeroMoments();
  V sum_aw = zero, sum_aw_x = zero, sum_aw_y = zero, sum_a_y = zero, sum_a_xy = zero, sum_a_yy = zero;
  V sum_abs = zero;
  const V per_sigma_u = set(texelsPerSigma(s.texture_width)), per_sigma_v = set(texelsPerSigma(s.texture_height));
  int i = 0;
  for (int column = 0; column < kColumns; ++column) {
    const int end = countBefore(samples.set, column + 1);
    const V x = columnX(s, tile_x, column);
    ColumnMoments column_b = zeroColumn(), column_u = zeroColumn(), column_v = zeroColumn();
    V aw = zero, aw_y = zero, a_y = zero, a_yy = zero;
    for (; i < end; ++i) {
      const Sample& sample = samples.at[i];
      const V y = set(rows.y[samples.row(i)]);
      const V w = hn::Load(df, sample.w);
      const V a = hn::Load(df, sample.value);
      V b = hn::Mul(a, hn::Load(df, sample.q));
      const V a_w = hn::Mul(a, w);
      const V ay = hn::Mul(a, y);
      aw = hn::Add(aw, a_w);
      aw_y = hn::MulAdd(a_w, y, aw_y);
      a_y = hn::Add(a_y, ay);
      a_yy = hn::MulAdd(ay, y, a_yy);
      V e_x = zero, e_y = zero;
      if constexpr (kStatistics) {
        // e: d|W|^2 = -2 W . (wx + kappa y) and -2 W . (wy - kappa x) per pixel of the projected mean.
        const V w_kappa = hn::MulAdd(set(s.kappa_second), y, hn::Mul(set(s.kappa_first), w));
        e_x = hn::MulAdd(w_kappa, y, hn::Mul(set(s.w_xx), w));
        e_y = hn::NegMulAdd(w_kappa, x, hn::MulAdd(set(s.w_yy * s.w_yy), y, hn::Mul(set(s.w_xy), w)));
      }
      if constexpr (kTexture) {
        // Step 4
        const CellSample& at = texture.cells.at[i];
        const V v_u = hn::Load(df, texture.at[i].v_u), v_v = hn::Load(df, texture.at[i].v_v);
        const V on_d2 = hn::MulAdd(v_u, hn::Load(df, at.u), hn::Mul(v_v, hn::Load(df, at.v)));
        b = hn::NegMulAdd(set(kInverseLn2), on_d2, b);
        add(column_u, v_u, y);
        add(column_v, v_v, y);
        if constexpr (kStatistics) {
          const NumeratorShift shift =
              numeratorShift(s, rows.y[samples.row(i)], x, hn::Mul(v_u, per_sigma_u), hn::Mul(v_v, per_sigma_v));
          e_x = hn::NegMulAdd(shift.e_x, set(0.5f * kInverseLn2), hn::Mul(e_x, a));
          e_y = hn::NegMulAdd(shift.e_y, set(0.5f * kInverseLn2), hn::Mul(e_y, a));
          e_x = hn::Mul(e_x, aspect);
          sum_abs = hn::Add(sum_abs, hn::Sqrt(hn::MulAdd(e_x, e_x, hn::Mul(e_y, e_y))));
        }
      } else if constexpr (kStatistics) {
        e_x = hn::Mul(e_x, aspect);
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
  storeSums(sum_aw, sum_aw_x, sum_aw_y, sum_a_y, &sums.aw);
  storeSums(sum_a_xy, sum_a_yy, of_b.c, of_b.x, &sums.a_xy);
  storeSums(of_b.y, of_b.xx, of_b.xy, of_b.yy, &sums.b_y);
  if constexpr (kStatistics) *screen_abs = size_y * sum(sum_abs);
  if constexpr (kTexture) {
    for (V* moment : {&of_u.c, &of_u.x, &of_u.y, &of_u.xx, &of_u.xy, &of_u.yy}) *moment = hn::Mul(*moment, per_sigma_u);
    for (V* moment : {&of_v.c, &of_v.x, &of_v.y, &of_v.xx, &of_v.xy, &of_v.yy}) *moment = hn::Mul(*moment, per_sigma_v);
    storeSums(of_u.c, of_u.x, of_u.y, of_u.xx, &texture_sums->u);
    storeSums(of_u.xy, of_u.yy, of_v.c, of_v.x, &texture_sums->u_xy);
    storeSums(of_v.y, of_v.xx, of_v.xy, of_v.yy, &texture_sums->v_y);
  }
}

// Step 3 for a small texture: dL/d(coefficient) of each cell, lane by lane, and from them the gradients of the texels.
HWY_INLINE void backwardSmall(const View& view, const Texture& texture, const Samples& samples,
                              TextureSamples& texture_samples, const GradientState& state, float* slot) {
  const CellSamples& cells = texture_samples.cells;
  for (std::uint32_t left = cells.touched; left != 0; left &= left - 1) {
    for (auto& channels : texture_samples.sums[std::countr_zero(left)]) {
      for (float* sum : channels) hn::Store(hn::Zero(df), df, sum);
    }
  }
  // v_texture: dL/d(texture) of a sample.
  const auto add = [&](int cell, const CellSample& at, const V* v_texture) HWY_ATTR {
    auto& sums = texture_samples.sums[cell];
    const V u = hn::Load(df, at.fraction_u), v = hn::Load(df, at.fraction_v);
    for (int ch = 0; ch < 4; ++ch) {
      const V along_u = hn::Mul(u, v_texture[ch]);
      hn::Store(hn::Add(hn::Load(df, sums[0][ch]), v_texture[ch]), df, sums[0][ch]);
      hn::Store(hn::Add(hn::Load(df, sums[1][ch]), along_u), df, sums[1][ch]);
      hn::Store(hn::MulAdd(v, v_texture[ch], hn::Load(df, sums[2][ch])), df, sums[2][ch]);
      hn::Store(hn::MulAdd(v, along_u, hn::Load(df, sums[3][ch])), df, sums[3][ch]);
    }
  };
  const auto v_texture = [&](int i, V* out) HWY_ATTR {
    const TextureSample& sample = texture_samples.at[i];
    const GradientBlock& pixels = state.blocks[samples.block[i]];
    const V weight = hn::Load(df, sample.weight);
    for (int ch = 0; ch < 3; ++ch) out[ch] = hn::Mul(weight, hn::Load(df, pixels.v_color[ch]));
    out[3] = hn::Load(df, sample.v_factor);
  };
  for (int k = 0; k < cells.uniform_count; ++k) {
    const int i = cells.uniform[k];
    V v[4];
    v_texture(i, v);
    add(cells.uniform_cell[k], cells.at[i], v);
  }
  for (int k = 0; k < cells.mixed_count; ++k) {
    const int i = cells.mixed[k];
    V v[4];
    v_texture(i, v);
    forEachCell(cells.at[i], cells.lanes[i], [&](int cell, M lanes) HWY_ATTR {
      V there[4];
      for (int ch = 0; ch < 4; ++ch) there[ch] = hn::IfThenElseZero(lanes, v[ch]);
      add(cell, cells.at[i], there);
    });
  }
  for (std::uint32_t left = cells.touched & ~(1u << kNoCell); left != 0; left &= left - 1) {
    const int cell = std::countr_zero(left);
    const auto& sums = texture_samples.sums[cell];
    alignas(16) float of[4][4];
    for (int j = 0; j < 4; ++j) {
      storeSums(hn::Load(df, sums[j][0]), hn::Load(df, sums[j][1]), hn::Load(df, sums[j][2]), hn::Load(df, sums[j][3]),
                of[j]);
    }
    float* to = slot + 4 * cellTexel(texture, cell);
    for (int ch = 0; ch < 4; ++ch) {
      if (ch < 3 ? !view.texture_rgb : !view.texture_alpha) continue;
      to[ch] += of[0][ch] - of[1][ch] - of[2][ch] + of[3][ch];
      to[texture.step_u + ch] += of[1][ch] - of[3][ch];
      to[texture.step_v + ch] += of[2][ch] - of[3][ch];
      to[texture.step_u + texture.step_v + ch] += of[3][ch];
    }
  }
}

// Step 3: the gradients of the texels, into the pair's slot.
HWY_INLINE void backwardTexels(const View& view, const Texture& texture, const Samples& samples,
                               const TextureSamples& texture_samples, const GradientState& state, float* slot) {
  for (int i = 0; i < samples.count; ++i) {
    const TextureSample& sample = texture_samples.at[i];
    const CellSample& cells = texture_samples.cells.at[i];
    const GradientBlock& pixels = state.blocks[samples.block[i]];
    TexturePoint at;
    at.fraction_u = hn::Load(df, cells.fraction_u);
    at.fraction_v = hn::Load(df, cells.fraction_v);
    at.cell = hn::BitCast(di, hn::Load(du, cells.cell));
    at.inside = hn::RebindMask(df, hn::Ne(at.cell, hn::Set(di, static_cast<std::int32_t>(kOutside))));
    const Corners corners = cornerWeights(at);
    const V weight = view.texture_rgb ? hn::Load(df, sample.weight) : hn::Zero(df);
    V v_rgb[3];
    for (int ch = 0; ch < 3; ++ch) v_rgb[ch] = hn::Mul(weight, hn::Load(df, pixels.v_color[ch]));
    const V v_a = view.texture_alpha ? hn::Load(df, sample.v_factor) : hn::Zero(df);
    forEachCell(at, [&](std::size_t cell, M lanes) HWY_ATTR {
      for (int k = 0; k < 4; ++k) {
        const V w = hn::IfThenElseZero(lanes, corners.weight[k]);
        addSums(hn::Mul(w, v_rgb[0]), hn::Mul(w, v_rgb[1]), hn::Mul(w, v_rgb[2]), hn::Mul(w, v_a),
                slot + cell + cornerStep(texture, k));
      }
    });
  }
}

// First and last cells that samples meet, as texels; first > last where there are none.
struct CellRange {
  std::uint32_t first, last;
};
HWY_INLINE CellRange cellRange(const Texture& texture, const CellSamples& cells) {
  const std::uint32_t touched = cells.touched & ~(1u << kNoCell);
  if (touched == 0) return {1, 0};
  return {static_cast<std::uint32_t>(cellTexel(texture, std::countr_zero(touched))),
          static_cast<std::uint32_t>(cellTexel(texture, std::bit_width(touched) - 1))};
}
HWY_INLINE CellRange cellRange(const Samples& samples, const CellSamples& cells) {
  VI low = hn::Set(di, std::numeric_limits<std::int32_t>::max());
  VI high = hn::Set(di, -1);  // as kOutside
  for (int i = 0; i < samples.count; ++i) {
    const VI cell = hn::BitCast(di, hn::Load(du, cells.at[i].cell));
    low = hn::Min(low, hn::IfThenElse(hn::Gt(cell, hn::Set(di, -1)), cell, low));
    high = hn::Max(high, cell);
  }
  const std::int32_t last = hn::GetLane(hn::MaxOfLanes(di, high));
  if (last < 0) return {1, 0};
  return {static_cast<std::uint32_t>(hn::GetLane(hn::MinOfLanes(di, low))), static_cast<std::uint32_t>(last)};
}

// The pair's texel gradients, zeroed in the rows that the cells touch.
HWY_INLINE float* openSlot(TexelSlots& slots, const Splat& s, std::uint32_t pair, CellRange cells) {
  TexelSlots::Range& written = slots.written[pair];
  written = {0, 0};
  glm::vec4* slot = slots.texels.data() + slots.begin[pair];
  if (cells.first <= cells.last) {
    const std::uint32_t width = s.texture_width;
    written.first = cells.first / width * width;
    written.end = std::min((cells.last / width + 2) * width, width * s.texture_height);
    using F4 = HWY_CAPPED(float, 4);
    constexpr F4 d4;
    float* end = &slot->x + std::size_t{4} * written.end;
    for (float* to = &slot->x + std::size_t{4} * written.first; to != end; to += hn::MaxLanes(d4)) {
      hn::StoreU(hn::Zero(d4), d4, to);
    }
  }
  return &slot->x;
}

HWY_INLINE void loadState(const BackwardInput& in, int tile, int tile_x, int tile_y, GradientState& state) {
  const int width = std::min(kTileWidth, in.view.size.x - tile_x);
  const int height = std::min(kTileHeight, in.view.size.y - tile_y);
  std::memset(&state, 0, sizeof(state));  // no splat passes a stop of 0
  for (int row = 0; row < height; ++row) {
    for (int x = 0; x < width; ++x) {
      GradientBlock& pixels = state.blocks[x / kLanes * kTileHeight + row];
      const int lane = x % kLanes;
      const std::size_t recorded = static_cast<std::size_t>(tile) * kTilePixels + row * kTileWidth + x;
      const std::size_t pixel =
          static_cast<std::size_t>(tile_y - in.lists.firstPixelY() + row) * in.view.size.x + tile_x + x;
      const glm::vec3 v_color = in.v_color[pixel];
      pixels.transmittance[lane] = in.record.transmittance[recorded];
      pixels.behind[lane] = in.record.transmittance[recorded] * glm::dot(v_color, in.view.background);
      for (int ch = 0; ch < 3; ++ch) pixels.v_color[ch][lane] = v_color[ch];
      pixels.stop[lane] = in.record.stop[recorded];
    }
  }
}

template <bool kStatistics>
void backwardTile(const BackwardArgs& args, int tile) {
  const BackwardInput& in = args.in;
  const int tile_x = in.lists.pixelX(tile);
  const int tile_y = in.lists.pixelY(tile);
  const std::span<const std::uint32_t> list = in.lists.list(tile);
  const std::uint32_t first = in.lists.begin[tile];

  GradientState state;
  loadState(in, tile, tile_x, tile_y, state);
  Rows rows;
  Samples samples;
  TextureSamples texture_samples;
  for (auto position = static_cast<std::int32_t>(list.size()) - 1; position >= 0; --position) {
    const std::uint32_t at = first + static_cast<std::uint32_t>(position);
    BlockSet blocks;
    std::copy_n(in.record.blocks.data() + std::size_t{at} * kWords, kWords, blocks.words);
    if (empty(blocks)) continue;
    const std::uint32_t pair = in.lists.pairs[at];
    args.shows[pair] = 1;
    const Splat& s = in.screen.splats[list[position]];
    if (position >= kSplatsAhead) {
      prefetchSplat(in.screen.splats[list[position - kSplatsAhead]]);
      const std::uint32_t ahead = in.lists.pairs[at - kSplatsAhead];
      hwy::Prefetch(&args.sums[ahead]);
      if (in.view.textured()) {
        hwy::Prefetch(&args.texture_sums[ahead]);
        hwy::Prefetch(&args.slots->begin[ahead]);
        hwy::Prefetch(&args.slots->written[ahead]);
      }
      prefetchTexels(in.screen.splats[list[position - 1]], in.texels);
    }
    PairSums& sums = args.sums[pair];
    float* screen_abs = kStatistics ? args.screen_abs + pair : nullptr;
    fillRows(s, tile_y, rows);
    const auto open = [&](M visible, int block) HWY_ATTR {
      const auto later = hn::Gt(hn::Load(di, state.blocks[block].stop), hn::Set(di, position));
      return hn::And(visible, hn::RebindMask(df, later));
    };
    evaluate<Keep::all>(s, rows, tile_x, blocks, open, samples);
    ColorPass pass(s, in.options.texture_in_suffix);
    if (s.texture_width > 0) {
      const Texture texture = makeTexture(s, in.texels);
      const bool small = isSmall(s);
      if (in.view.outside == TextureOutside::clip) clipToTexture(s, rows, tile_x, samples);
      if (small) {
        colorSmall(texture, s, in.view, tile_x, tile_y, pass, state, samples, texture_samples);
      } else {
        colorTextured(texture, s, in.view, rows, tile_x, pass, state, samples, texture_samples);
      }
      pass.store(sums);
      PairTextureSums& texture_sums = args.texture_sums[pair];
      if (in.options.texture_to_geometry) {
        backwardGeometry<true, kStatistics>(in.view, s, rows, tile_x, samples, texture_samples, sums, screen_abs,
                                            &texture_sums);
      } else {
        texture_sums = {};
        backwardGeometry<false, kStatistics>(in.view, s, rows, tile_x, samples, texture_samples, sums, screen_abs,
                                             nullptr);
      }
      if (small) {
        float* slot = openSlot(*args.slots, s, pair, cellRange(texture, texture_samples.cells));
        backwardSmall(in.view, texture, samples, texture_samples, state, slot);
      } else {
        float* slot = openSlot(*args.slots, s, pair, cellRange(samples, texture_samples.cells));
        backwardTexels(in.view, texture, samples, texture_samples, state, slot);
      }
    } else {
      for (int i = 0; i < samples.count; ++i) {
        pass.visit<false>(nullptr, samples.at[i], state.blocks[samples.block[i]], nullptr);
      }
      pass.store(sums);
      backwardGeometry<false, kStatistics>(in.view, s, rows, tile_x, samples, texture_samples, sums, screen_abs,
                                           nullptr);
    }
  }
}

void backwardTileAll(const BackwardArgs& args, int tile) { backwardTile<true>(args, tile); }
void backwardTileGradient(const BackwardArgs& args, int tile) { backwardTile<false>(args, tile); }

}  // namespace
}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
HWY_EXPORT(backwardTileAll);
HWY_EXPORT(backwardTileGradient);

void backwardTiles(const BackwardInput& input, int first_tile, int end_tile, const PairGradients& out) {
  TG_ASSERT(first_tile >= 0 && first_tile <= end_tile && end_tile <= input.lists.tiles(),
            "the picture has these tiles");
  TG_ASSERT(input.lists.tiles() == 0 || input.v_color.size() % static_cast<std::size_t>(input.view.size.x) == 0,
            "a derivative a pixel of the lists' rows");
  TG_ASSERT(out.shows.size() == input.lists.splats.size() && out.sums.size() == input.lists.splats.size(),
            "sums for every pair");
  const BackwardArgs args{input,     out.shows.data(), out.sums.data(), out.screen_abs.data(), out.texture_sums.data(),
                          &out.slots};
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
