// SPDX-License-Identifier: Apache-2.0
// Bilinear look-ups in textures of up to 4 x 4 texels, for vectors of pixels and without a branch. Of two neighbouring
// rows one is even and one is odd, and so of two columns: the even rows of a channel are one register of eight texels,
// the odd rows another, and each of the four taps is one permutation of one of them.
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

// Colours, and alpha's deviation from 1. Texels beyond the texture's sides have no weight.
struct SmallTexture {
  static constexpr int kTexels = std::max(kLanes, 8);
  alignas(64) float rows[2][4][kTexels];  // even and odd rows, channel, 4 * (row / 2) + column
};
HWY_INLINE void fillSmall(const Texture& texture, int width, int height, bool with_rgb, bool with_alpha,
                          SmallTexture& small) {
  using F4 = HWY_CAPPED(float, 4);
  constexpr F4 d4;
  alignas(64) float padded[4 * kSmallSide * kSmallSide];
  const float* from = texture.texels;
  if (width < kSmallSide || height < kSmallSide) {
    for (int j = 0; j < kSmallSide; ++j) {
      for (int i = 0; i < kSmallSide; ++i) {
        const int texel = std::min(j, height - 1) * width + std::min(i, width - 1);
        std::copy_n(texture.texels + 4 * texel, 4, padded + 4 * (j * kSmallSide + i));
      }
    }
    from = padded;
  }
  constexpr int kStep = static_cast<int>(hn::MaxLanes(F4()));
  for (int j = 0; j < kSmallSide; ++j) {
    for (int i = 0; i < kSmallSide; i += kStep) {
      hn::Vec<F4> channel[4];
      hn::LoadInterleaved4(d4, from + 4 * (j * kSmallSide + i), channel[0], channel[1], channel[2], channel[3]);
      channel[3] = hn::Sub(channel[3], hn::Set(d4, 1.0f));
      for (int ch = 0; ch < 4; ++ch) {
        float* to = small.rows[j % 2][ch] + j / 2 * kSmallSide + i;
        for (int copy = 0; copy < SmallTexture::kTexels; copy += 8) hn::Store(channel[ch], d4, to + copy);
      }
    }
  }
  for (int ch = 0; ch < 4; ++ch) {
    if (ch < 3 ? with_rgb : with_alpha) continue;
    for (auto& rows : small.rows) std::fill_n(rows[ch], SmallTexture::kTexels, 0.0f);
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
HWY_INLINE SmallTaps smallTaps(const SmallPoint& point) {
  const V one = set(1.0f), two = set(2.0f);
  // The even ones of the two are 0 or 2, the odd ones 1 or 3.
  const M u_even = hn::Ge(point.u, one), u_odd = hn::Ge(point.u, two);
  const M v_even = hn::Ge(point.v, one), v_odd = hn::Ge(point.v, two);
  const auto bits = [](M mask, std::int32_t value)
                        HWY_ATTR { return hn::IfThenElseZero(hn::RebindMask(di, mask), hn::Set(di, value)); };
  const VI columns[2] = {bits(u_even, 2), hn::Or(bits(u_odd, 2), hn::Set(di, 1))};
  const VI rows[2] = {bits(v_even, 4), bits(v_odd, 4)};
  const M inside = isInside(point);
  const V from_u = hn::Abs(hn::Sub(point.u, hn::Add(one, hn::IfThenElseZero(u_odd, two))));
  const V from_v = hn::Abs(hn::Sub(point.v, hn::Add(one, hn::IfThenElseZero(v_odd, two))));
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

// `sum` and a channel of the texture.
HWY_INLINE V addSmall(const SmallTexture& texture, int ch, const SmallTaps& taps, V sum) {
  for (int j = 0; j < 2; ++j) {
    const V row = hn::Load(df, texture.rows[j][ch]);
    for (int i = 0; i < 2; ++i) sum = hn::MulAdd(taps.weight[j][i], hn::TableLookupLanes(row, taps.at[j][i]), sum);
  }
  return sum;
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
