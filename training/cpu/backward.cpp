// SPDX-License-Identifier: Apache-2.0
// Per tile, splats back to front; per splat, columns of vectors; down a column x is fixed and y a scalar, so sums over
// rows of {1, y, y^2} suffice and take their powers of x once a column.
#include "training/cpu/backward.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "core/parallel.h"

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
  std::int32_t row_stop[kColumns][kTileHeight];  // highest stop of a vector
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

// The splat's texture at a vector of pixels, as seen by a loss: per corner the texel's alpha and the loss's derivative
// along its colour.
struct TextureGradient {
  Corners corners;
  V along[4];  // dL/d(picture) . texel colour
  V alpha[4];
  V value_along;
  V value_alpha;
};
HWY_INLINE TextureGradient lookUp(const Texture& texture, const TexturePoint& at, const View& view,
                                  const V v_color[3]) {
  const V zero = hn::Zero(df);
  TextureGradient value{cornerWeights(at), {zero, zero, zero, zero}, {zero, zero, zero, zero}, zero, zero};
  forEachCell(at, [&](std::size_t cell, M lanes) HWY_ATTR {
    for (int k = 0; k < 4; ++k) {
      const float* texel = texture.texels + cell + cornerStep(texture, k);
      if (view.texture_rgb) {
        const V along = hn::MulAdd(v_color[2], set(texel[2]),
                                   hn::MulAdd(v_color[1], set(texel[1]), hn::Mul(v_color[0], set(texel[0]))));
        value.along[k] = hn::IfThenElse(lanes, along, value.along[k]);
      }
      value.alpha[k] = hn::IfThenElse(lanes, set(texel[3]), value.alpha[k]);
    }
  });
  for (int k = 0; k < 4; ++k) {
    value.value_along = hn::MulAdd(value.corners.weight[k], value.along[k], value.value_along);
    value.value_alpha =
        hn::MulAdd(value.corners.weight[k], hn::Sub(value.alpha[k], set(1.0f)), value.value_alpha);
  }
  value.value_alpha = view.texture_alpha ? alphaFactor(at.inside, value.value_alpha) : set(1.0f);
  return value;
}

// e of method A.6 without its factor -dL: how dN_u, dN_v (numerators of u, v) change as the projected mean moves.
struct ScreenChange {
  V u_x, v_x, u_y, v_y;
};
HWY_INLINE ScreenChange screenChange(const Splat& s, const LocalRay& ray, float y, V x) {
  const V xa = set(s.wx.x + s.kappa.x * y);
  const V xb = set(s.wx.y + s.kappa.y * y);
  const V xc = set(s.wx.z + s.kappa.z * y);
  const V ya = hn::NegMulAdd(set(s.kappa.x), x, set(s.wy.x));
  const V yb = hn::NegMulAdd(set(s.kappa.y), x, set(s.wy.y));
  const V yc = hn::NegMulAdd(set(s.kappa.z), x, set(s.wy.z));
  return {hn::MulSub(ray.d_b, xc, hn::Mul(ray.d_c, xb)), hn::MulSub(ray.d_c, xa, hn::Mul(ray.d_a, xc)),
          hn::MulSub(ray.d_b, yc, hn::Mul(ray.d_c, yb)), hn::MulSub(ray.d_c, ya, hn::Mul(ray.d_a, yc))};
}

template <bool kTexture>
void backwardSplat(const BackwardArgs& args, const Splat& s, std::int32_t position, std::uint32_t pair, int tile_x,
                   const Rows& rows, GradientState& state) {
  const View& view = args.in.view;
  const V zero = hn::Zero(df);
  const float ndc_x = 0.5f * static_cast<float>(view.width);
  const float ndc_y = 0.5f * static_cast<float>(view.height);
  Texture texture{};
  glm::vec4* slot = nullptr;
  if constexpr (kTexture) {
    texture = makeTexture(s, args.in.texels);
    slot = args.slots->texels.data() + args.slots->begin[pair - args.slots->first];
    std::fill_n(slot, std::size_t{s.texture_width} * s.texture_height, glm::vec4(0.0f));
    args.slots->used[pair - args.slots->first] = 1;
  }

  Moments of_b = zeroMoments(), of_u = zeroMoments(), of_v = zeroMoments();
  V sum_aw = zero, sum_aw_x = zero, sum_aw_y = zero, sum_a_y = zero, sum_a_xy = zero, sum_a_yy = zero;
  V sum_base[3] = {zero, zero, zero};
  V sum_power = zero, sum_abs = zero;
  for (int column = 0; column < kColumns; ++column) {
    std::uint32_t bits = rows.active[column];
    if (bits == 0) continue;
    const V x = columnX(s, tile_x, column);
    const V wx = hn::Mul(set(s.w_xx), x);
    const V dx = hn::Mul(set(s.d_xx), x);
    ColumnMoments column_b = zeroColumn(), column_u = zeroColumn(), column_v = zeroColumn();
    V aw = zero, aw_y = zero, a_y = zero, a_yy = zero;
    for (; bits != 0; bits &= bits - 1) {
      const int row = std::countr_zero(bits);
      if (state.row_stop[column][row] <= position) continue;
      const int at = offsetOf(column, row);
      const float y = rows.y[row];
      const Hit hit = evaluate(s, rows, row, wx, dx);
      const V v_color[3] = {hn::Load(df, state.v_color[0] + at), hn::Load(df, state.v_color[1] + at),
                            hn::Load(df, state.v_color[2] + at)};
      const M open = hn::RebindMask(df, hn::Gt(hn::Load(di, state.stop + at), hn::Set(di, position)));
      V alpha_raw = hit.value;
      LocalRay ray{};
      TexturePoint point{};
      TextureGradient sample{};
      if constexpr (kTexture) {
        ray = localRay(s, y, x);
        point = locate(texture, ray, hit, hn::And(open, hn::Ge(hit.value, set(kAlphaMin))));
        sample = lookUp(texture, point, view, v_color);
        alpha_raw = hn::Mul(alpha_raw, sample.value_alpha);
      }
      const V alpha = hn::Min(alpha_raw, set(kAlphaMax));
      const M blended = hn::And(open, visibleLanes(s, y, x, hit, alpha));
      if (hn::AllFalse(df, blended)) continue;

      // Step 1: colour and alpha, the transmittance before the splat rebuilt from the one behind it.
      const V inverse = hn::Div(set(1.0f), hn::Sub(set(1.0f), alpha));
      const V transmittance = hn::Load(df, state.transmittance + at);
      const V before = hn::Mul(transmittance, inverse);
      const V weight = hn::IfThenElseZero(blended, hn::Mul(before, alpha));
      V along = hn::MulAdd(v_color[2], set(s.base.z),
                           hn::MulAdd(v_color[1], set(s.base.y), hn::Mul(v_color[0], set(s.base.x))));
      if constexpr (kTexture) along = hn::Add(along, sample.value_along);
      const V behind = hn::Load(df, state.behind + at);
      const V v_alpha = hn::MulSub(before, along, hn::Mul(behind, inverse));
      hn::Store(hn::MulAdd(weight, along, behind), df, state.behind + at);
      hn::Store(hn::IfThenElse(blended, before, transmittance), df, state.transmittance + at);
      V v_base[3];
      for (int ch = 0; ch < 3; ++ch) {
        v_base[ch] = hn::Mul(weight, v_color[ch]);
        sum_base[ch] = hn::Add(sum_base[ch], v_base[ch]);
      }

      // Steps 2 and 5: power = |W|^2 / |D|^2; nothing flows through a clamped alpha.
      const M flows = hn::And(blended, hn::Lt(alpha_raw, set(kAlphaMax)));
      const V v_power = hn::IfThenElseZero(flows, hn::Mul(hn::Mul(v_alpha, alpha_raw), set(-0.5f)));
      const V a = hn::Mul(v_power, hit.inverse_d2);
      V b = hn::Neg(hn::Mul(a, hit.power));
      sum_power = hn::Add(sum_power, v_power);
      const V a_w = hn::Mul(a, hit.w);
      aw = hn::Add(aw, a_w);
      aw_y = hn::MulAdd(a_w, set(y), aw_y);
      a_y = hn::MulAdd(a, set(y), a_y);
      a_yy = hn::MulAdd(a, set(y * y), a_yy);

      // e: d|W|^2 = -2 (W . (wx + kappa y)) and -2 (W . (wy - kappa x)) per pixel of the projected mean.
      const V w_kappa = hn::MulAdd(set(s.kappa_first), hit.w, set(s.kappa_second * y));
      V e_x = hn::MulAdd(w_kappa, set(2.0f * y), hn::Mul(set(2.0f * s.w_xx), hit.w));
      V e_y = hn::MulAdd(set(s.w_xy), hit.w, hn::NegMulAdd(w_kappa, x, set(s.w_yy * s.w_yy * y)));
      e_x = hn::Mul(e_x, a);
      e_y = hn::Mul(hn::Add(e_y, e_y), a);

      if constexpr (kTexture) {
        // Steps 3 and 4.
        const V v_sample_alpha = view.texture_alpha ? hn::IfThenElseZero(flows, hn::Mul(v_alpha, hit.value)) : zero;
        V v_corner[4];
        for (int k = 0; k < 4; ++k) {
          v_corner[k] = hn::MulAdd(weight, sample.along[k], hn::Mul(v_sample_alpha, sample.alpha[k]));
        }
        const V one = set(1.0f);
        const V down = hn::Sub(v_corner[1], v_corner[0]);
        const V up = hn::Sub(v_corner[3], v_corner[2]);
        const V left = hn::Sub(v_corner[2], v_corner[0]);
        const V right = hn::Sub(v_corner[3], v_corner[1]);
        const V v_u = hn::Mul(set(texture.texels_per_sigma_u),
                              hn::MulAdd(point.fraction_v, up, hn::Mul(hn::Sub(one, point.fraction_v), down)));
        const V v_v = hn::Mul(set(texture.texels_per_sigma_v),
                              hn::MulAdd(point.fraction_u, right, hn::Mul(hn::Sub(one, point.fraction_u), left)));
        const V u_numerator = hn::IfThenElseZero(point.inside, hn::Mul(v_u, hit.inverse_d2));
        const V v_numerator = hn::IfThenElseZero(point.inside, hn::Mul(v_v, hit.inverse_d2));
        b = hn::NegMulAdd(u_numerator, point.u, hn::NegMulAdd(v_numerator, point.v, b));
        add(column_u, u_numerator, y);
        add(column_v, v_numerator, y);
        const ScreenChange change = screenChange(s, ray, y, x);
        e_x = hn::MulAdd(u_numerator, change.u_x, hn::MulAdd(v_numerator, change.v_x, e_x));
        e_y = hn::MulAdd(u_numerator, change.u_y, hn::MulAdd(v_numerator, change.v_y, e_y));
        forEachCell(point, [&](std::size_t cell, M lanes) HWY_ATTR {
          for (int k = 0; k < 4; ++k) {
            const V w = hn::IfThenElseZero(lanes, sample.corners.weight[k]);
            const V rgb_weight = view.texture_rgb ? w : hn::Zero(df);
            addLaneSums(hn::Mul(rgb_weight, v_base[0]), hn::Mul(rgb_weight, v_base[1]), hn::Mul(rgb_weight, v_base[2]),
                        hn::Mul(w, v_sample_alpha), &slot->x + cell + cornerStep(texture, k));
          }
        });
      }
      add(column_b, b, y);
      e_x = hn::Mul(e_x, set(ndc_x));
      e_y = hn::Mul(e_y, set(ndc_y));
      sum_abs = hn::Add(sum_abs, hn::Sqrt(hn::MulAdd(e_x, e_x, hn::Mul(e_y, e_y))));
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

  PairSums& out = args.sums[pair];
  out.aw = sum(sum_aw);
  out.aw_x = sum(sum_aw_x);
  out.aw_y = sum(sum_aw_y);
  out.a_y = sum(sum_a_y);
  out.a_xy = sum(sum_a_xy);
  out.a_yy = sum(sum_a_yy);
  store(of_b, &out.b);
  for (int ch = 0; ch < 3; ++ch) out.base[ch] = sum(sum_base[ch]);
  out.power = sum(sum_power);
  out.screen_abs = sum(sum_abs);
  if constexpr (kTexture) {
    store(of_u, &args.texture_sums[pair].u);
    store(of_v, &args.texture_sums[pair].v);
  }
}

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
      const auto stop = static_cast<std::int32_t>(in.record.stop[recorded]);
      state.transmittance[at] = in.record.transmittance[recorded];
      state.behind[at] = in.record.transmittance[recorded] * glm::dot(v_color, in.view.background);
      for (int ch = 0; ch < 3; ++ch) state.v_color[ch][at] = v_color[ch];
      state.stop[at] = stop;
      state.row_stop[x / kLanes][row] = std::max(state.row_stop[x / kLanes][row], stop);
      end = std::max(end, stop);
    }
  }
  Rows rows;
  for (auto position = static_cast<std::int32_t>(list.size()) - 1; position >= 0; --position) {
    const Splat& s = in.screen.splats[list[position]];
    const std::uint32_t pair = first_pair + static_cast<std::uint32_t>(position);
    if (position >= end || !prepareRows(s, tile_x, tile_y, rows)) {
      args.sums[pair] = {};
      if (in.view.textured()) args.texture_sums[pair] = {};
    } else if (s.texture_width > 0) {
      backwardSplat<true>(args, s, position, pair, tile_x, rows, state);
    } else {
      backwardSplat<false>(args, s, position, pair, tile_x, rows, state);
      if (in.view.textured()) args.texture_sums[pair] = {};
    }
  }
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
HWY_EXPORT(backwardTile);

void backwardTiles(const BackwardInput& input, int first_tile, int end_tile, std::span<PairSums> sums,
                   std::span<PairTextureSums> texture_sums, TexelSlots& slots) {
  const BackwardArgs args{input, sums.data(), texture_sums.data(), &slots};
  parallelFor(end_tile - first_tile, 1,
              [&](std::int64_t i) { HWY_DYNAMIC_DISPATCH(backwardTile)(args, first_tile + static_cast<int>(i)); });
}

}  // namespace tg::cpu
#endif
