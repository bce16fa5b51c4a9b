// SPDX-License-Identifier: Apache-2.0
// Bilinear look-ups in textures of up to 4 x 4 texels, with vectors of 16 floats 8 x 8, for vectors of pixels and
// without a branch. Of two neighbouring rows one is even and one is odd, and so of two columns. Of 4 x 4 texels the
// even rows of a channel are one register of eight, the odd rows another, and each of the four taps is one permutation
// of one of them; of 8 x 8 texels each tap has a register of its own, those of its rows and columns.
#include "render/cpu/texture-inl.h"

#if defined(TG_RENDER_CPU_SMALL_TEXTURE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TG_RENDER_CPU_SMALL_TEXTURE_INL_H
#undef TG_RENDER_CPU_SMALL_TEXTURE_INL_H
#else
#define TG_RENDER_CPU_SMALL_TEXTURE_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {

// Vectors of four floats would need twice the permutations, and a choice.
constexpr bool kSmallTextures = kLanes >= 8;
constexpr int kWideSide = 8;  // [texels]
constexpr bool kWideTextures = kLanes >= 16;
template <class S>
HWY_INLINE bool isWide(const S& s) {
  return std::max(s.texture_width, s.texture_height) <= kWideSide;
}

// Colours, and alpha's deviation from 1. Texels beyond the texture's sides have no weight.
template <int kSide>
struct SmallTexture {
  static_assert(kSide == kSmallSide || kSide == kWideSide);
  static constexpr bool kWide = kSide == kWideSide;
  static constexpr int kTexels = std::max(kLanes, 8);
  // Even and odd rows, channel; wide: even and odd columns, 4 * (row / 2) + column / 2; else 4 * (row / 2) + column
  alignas(64) float rows[2][4][kWide ? 2 : 1][kTexels];
};
// Texels [0, kSide) of a row.
template <int kSide>
HWY_INLINE void fillRow(const float* from, int row, SmallTexture<kSide>& small) {
  using F4 = HWY_CAPPED(float, 4);
  constexpr F4 d4;
  using V4 = hn::Vec<F4>;
  constexpr int kStep = static_cast<int>(hn::MaxLanes(F4()));
  const auto load = [&](int i, V4(&channel)[4]) HWY_ATTR {
    hn::LoadInterleaved4(d4, from + 4 * i, channel[0], channel[1], channel[2], channel[3]);
    channel[3] = hn::Sub(channel[3], hn::Set(d4, 1.0f));
  };
  if constexpr (SmallTexture<kSide>::kWide) {
    V4 left[4], right[4];
    load(0, left);
    load(4, right);
    for (int ch = 0; ch < 4; ++ch) {
      auto& columns = small.rows[row % 2][ch];
      hn::Store(hn::ConcatEven(d4, right[ch], left[ch]), d4, columns[0] + row / 2 * 4);
      hn::Store(hn::ConcatOdd(d4, right[ch], left[ch]), d4, columns[1] + row / 2 * 4);
    }
  } else {
    for (int i = 0; i < kSide; i += kStep) {
      V4 channel[4];
      load(i, channel);
      for (int ch = 0; ch < 4; ++ch) {
        float* to = small.rows[row % 2][ch][0] + row / 2 * kSide + i;
        for (int copy = 0; copy < SmallTexture<kSide>::kTexels; copy += 8) hn::Store(channel[ch], d4, to + copy);
      }
    }
  }
}
template <int kSide>
HWY_INLINE void fillSmall(const Texture& texture, int width, int height, bool with_rgb, bool with_alpha,
                          SmallTexture<kSide>& small) {
  alignas(64) float padded[4 * kSide * kSide];
  const float* from = texture.texels;
  if (width < kSide || height < kSide) {
    for (int j = 0; j < kSide; ++j) {
      for (int i = 0; i < kSide; ++i) {
        const int texel = std::min(j, height - 1) * width + std::min(i, width - 1);
        std::copy_n(texture.texels + 4 * texel, 4, padded + 4 * (j * kSide + i));
      }
    }
    from = padded;
  }
  for (int j = 0; j < kSide; ++j) fillRow(from + 4 * j * kSide, j, small);
  for (int ch = 0; ch < 4; ++ch) {
    if (ch < 3 ? with_rgb : with_alpha) continue;
    for (auto& rows : small.rows) {
      for (auto& columns : rows[ch]) std::fill_n(columns, SmallTexture<kSide>::kTexels, 0.0f);
    }
  }
}

// Where a vector of pixels falls on such a texture, in texels; `u` is below -1/2 where the texture does not apply.
struct SmallPoint {
  V u, v;
};
// kEdge: TextureOutside::edge.
template <bool kEdge>
HWY_INLINE SmallPoint locateSmall(const Texture& texture, const LocalRay& ray, V inverse_d2) {
  const LocalPoint point = localPoint(ray, inverse_d2);
  const float per_u = texture.texels_per_sigma_u, per_v = texture.texels_per_sigma_v;
  const V u = hn::MulAdd(point.u, set(per_u), set(kTextureExtent * per_u));
  const V v = hn::MulAdd(point.v, set(per_v), set(kTextureExtent * per_v));
  if constexpr (kEdge) return {onBorder(u, texture.last_u), onBorder(v, texture.last_v)};
  const M inside = insideTexture(point);
  return {hn::IfThenElse(inside, u, set(-1.0f)), hn::IfThenElseZero(inside, v)};
}
HWY_INLINE M isInside(const SmallPoint& point) { return hn::Ge(point.u, set(-0.5f)); }

// Taps of even and odd rows, in even and odd columns: where they are in a register, and their weights, all 0 where the
// texture does not apply.
struct SmallTaps {
  decltype(hn::IndicesFromVec(df, VI())) at[2][2];
  V weight[2][2];
};
// From the distances [texels] of a point from its odd row and column, and from where its two rows and columns are.
HWY_INLINE SmallTaps tapsOf(const SmallPoint& point, V from_u, V from_v, const VI (&rows)[2], const VI (&columns)[2]) {
  const V one = set(1.0f);
  const M inside = isInside(point);
  const V weight_u[2] = {from_u, hn::Sub(one, from_u)};
  const V weight_v[2] = {hn::IfThenElseZero(inside, from_v), hn::IfThenElseZero(inside, hn::Sub(one, from_v))};
  SmallTaps taps;
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      taps.at[j][i] = hn::IndicesFromVec(df, hn::Or(rows[j], columns[i]));
      taps.weight[j][i] = hn::Mul(weight_v[j], weight_u[i]);
    }
  }
  return taps;
}
HWY_INLINE SmallTaps smallTaps(const SmallTexture<kSmallSide>&, const SmallPoint& point) {
  const V one = set(1.0f), two = set(2.0f);
  // The even ones of the two are 0 or 2, the odd ones 1 or 3.
  const M u_even = hn::Ge(point.u, one), u_odd = hn::Ge(point.u, two);
  const M v_even = hn::Ge(point.v, one), v_odd = hn::Ge(point.v, two);
  const auto bits = [](M mask, std::int32_t value)
                        HWY_ATTR { return hn::IfThenElseZero(hn::RebindMask(di, mask), hn::Set(di, value)); };
  const VI columns[2] = {bits(u_even, 2), hn::Or(bits(u_odd, 2), hn::Set(di, 1))};
  const VI rows[2] = {bits(v_even, 4), bits(v_odd, 4)};
  const V from_u = hn::Abs(hn::Sub(point.u, hn::Add(one, hn::IfThenElseZero(u_odd, two))));
  const V from_v = hn::Abs(hn::Sub(point.v, hn::Add(one, hn::IfThenElseZero(v_odd, two))));
  return tapsOf(point, from_u, from_v, rows, columns);
}
// The even one of a cell's two columns (rows), halved, and the odd one likewise; how far a point is from the odd one.
struct WideAxis {
  VI even, odd;
  V from_odd;
};
HWY_INLINE WideAxis wideAxis(V texel) {
  const V last = set(static_cast<float>(kWideSide - 2));
  const VI cell = hn::ConvertTo(di, hn::Min(hn::Max(texel, hn::Zero(df)), last));
  const VI odd = hn::ShiftRight<1>(cell);
  const V column = hn::MulAdd(hn::ConvertTo(df, odd), set(2.0f), set(1.0f));
  return {hn::ShiftRight<1>(hn::Add(cell, hn::Set(di, 1))), odd, hn::Abs(hn::Sub(texel, column))};
}
HWY_INLINE SmallTaps smallTaps(const SmallTexture<kWideSide>&, const SmallPoint& point) {
  const WideAxis u = wideAxis(point.u), v = wideAxis(point.v);
  const VI rows[2] = {hn::ShiftLeft<2>(v.even), hn::ShiftLeft<2>(v.odd)};
  const VI columns[2] = {u.even, u.odd};
  return tapsOf(point, u.from_odd, v.from_odd, rows, columns);
}

// `sum` and a channel of the texture.
template <int kSide>
HWY_INLINE V addSmall(const SmallTexture<kSide>& texture, int ch, const SmallTaps& taps, V sum) {
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const V texels = hn::Load(df, texture.rows[j][ch][SmallTexture<kSide>::kWide ? i : 0]);
      sum = hn::MulAdd(taps.weight[j][i], hn::TableLookupLanes(texels, taps.at[j][i]), sum);
    }
  }
  return sum;
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
