// SPDX-License-Identifier: Apache-2.0
// Bilinear texture look-ups for a vector of pixels. Neighbouring pixels mostly fall into one texel cell, so cells are
// visited one by one with their four texels broadcast, instead of sixteen gathers. Tried and lost: loads and a
// transpose per lane (forward the same, backward a tenth slower); tables of 4 x 4 texels looked up by byte shuffles,
// eight a channel, without a loop over cells (both the same; small_texture-inl.h needs four permutations); the
// numerators of u and v as polynomials in x (edge-on splats of the plane model lose a digit).
#include "render/cpu/kernel-inl.h"
#include "shared/texture.h"

#if defined(TG_RENDER_CPU_TEXTURE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TG_RENDER_CPU_TEXTURE_INL_H
#undef TG_RENDER_CPU_TEXTURE_INL_H
#else
#define TG_RENDER_CPU_TEXTURE_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {

// A splat's texture rectangle, ready for look-ups.
struct Texture {
  const float* texels;  // rgba of texel (0, 0)
  std::uint32_t width;
  std::ptrdiff_t step_u, step_v;  // [floats] to the texel i1, j1; 0 on a one-texel axis
  float texels_per_sigma_u, texels_per_sigma_v;
  float last_u, last_v;  // last cell
};

// s: a Splat or a PictureHit.
template <class S>
HWY_INLINE Texture makeTexture(const S& s, const glm::vec4* texels) {
  Texture t;
  t.texels = &texels[s.texel_offset].x;
  t.width = s.texture_width;
  t.step_u = s.texture_width > 1 ? 4 : 0;
  t.step_v = s.texture_height > 1 ? std::ptrdiff_t{4} * s.texture_width : 0;
  t.texels_per_sigma_u = texelsPerSigma(s.texture_width);
  t.texels_per_sigma_v = texelsPerSigma(s.texture_height);
  t.last_u = static_cast<float>(std::max(s.texture_width - 2, 0));
  t.last_v = static_cast<float>(std::max(s.texture_height - 2, 0));
  return t;
}

constexpr int kSmallSide = 4;  // [texels] of textures with look-ups of their own
template <class S>
HWY_INLINE bool isSmall(const S& s) {
  return std::max(s.texture_width, s.texture_height) <= kSmallSide;
}

// Where a vector of pixels falls on a texture.
struct TexturePoint {
  V u, v;                    // [sigma]
  M inside;                  // lanes to which the texture applies
  V fraction_u, fraction_v;  // in the cell
  VI cell;                   // texel index of its first corner
};

// The components of W and D at a vector of pixels (Geometry::power_w, power_d).
struct LocalRay {
  V w_a, w_b, w_c, d_a, d_b, d_c;
};
template <class S>
HWY_INLINE LocalRay localRay(const S& s, float y, V x) {
  LocalRay ray;
  ray.w_a = hn::MulAdd(set(s.wx.x), x, set(s.wy.x * y));
  ray.w_b = hn::MulAdd(set(s.wx.y), x, set(s.wy.y * y));
  ray.w_c = hn::MulAdd(set(s.wx.z), x, set(s.wy.z * y));
  ray.d_a = hn::MulAdd(set(s.dx.x), x, set(s.dy.x * y + s.d0.x));
  ray.d_b = hn::MulAdd(set(s.dx.y), x, set(s.dy.y * y + s.d0.y));
  ray.d_c = hn::MulAdd(set(s.dx.z), x, set(s.dy.z * y + s.d0.z));
  return ray;
}
// For loops that keep a splat's numbers in vectors.
template <class S>
HWY_INLINE LocalRay localRay(const S& s, V y, V x) {
  LocalRay ray;
  ray.w_a = hn::MulAdd(set(s.wx.x), x, hn::Mul(set(s.wy.x), y));
  ray.w_b = hn::MulAdd(set(s.wx.y), x, hn::Mul(set(s.wy.y), y));
  ray.w_c = hn::MulAdd(set(s.wx.z), x, hn::Mul(set(s.wy.z), y));
  ray.d_a = hn::MulAdd(set(s.dx.x), x, hn::MulAdd(set(s.dy.x), y, set(s.d0.x)));
  ray.d_b = hn::MulAdd(set(s.dx.y), x, hn::MulAdd(set(s.dy.y), y, set(s.d0.y)));
  ray.d_c = hn::MulAdd(set(s.dx.z), x, hn::MulAdd(set(s.dy.z), y, set(s.d0.z)));
  return ray;
}

// LocalRay's parts that the rows and the columns of a tile fix, of one splat.
struct TileRays {
  alignas(64) float rows[6][kTileHeight + kLanes];
  alignas(64) float columns[6][kTileWidth];

  // column: [px] of the first lane
  HWY_INLINE LocalRay at(int row, int column) const {
    const auto part = [&](int k) HWY_ATTR { return hn::Add(hn::Load(df, columns[k] + column), set(rows[k][row])); };
    return {part(0), part(1), part(2), part(3), part(4), part(5)};
  }
};
// Rows [range.begin, range.end), and up to a vector more, of a splat (S) or of the PictureHit of one.
template <class S, class Hit>
HWY_INLINE void fillRays(const S& s, const Hit& hit, int tile_x, int tile_y, RowRange range, TileRays& rays) {
  const V x = hn::Iota(df, static_cast<float>(tile_x) + 0.5f), y = hn::Iota(df, static_cast<float>(tile_y) + 0.5f);
  for (int k = 0; k < 3; ++k) {
    for (int c = 0; c < kColumns; ++c) {
      const V left = hn::Sub(hn::Add(x, set(static_cast<float>(c * kLanes))), set(s.center_x));
      hn::Store(hn::Mul(set(hit.wx[k]), left), df, rays.columns[k] + c * kLanes);
      hn::Store(hn::Mul(set(hit.dx[k]), left), df, rays.columns[3 + k] + c * kLanes);
    }
    for (int r = range.begin; r < range.end; r += kLanes) {
      const V top = hn::Sub(hn::Add(y, set(static_cast<float>(r))), set(s.center_y));
      hn::StoreU(hn::Mul(set(hit.wy[k]), top), df, rays.rows[k] + r);
      hn::StoreU(hn::MulAdd(set(hit.dy[k]), top, set(hit.d0[k])), df, rays.rows[3 + k] + r);
    }
  }
}

// [sigma]
struct LocalPoint {
  V u, v;
};
HWY_INLINE LocalPoint localPoint(const LocalRay& ray, V inverse_d2) {
  return {hn::Mul(hn::MulSub(ray.d_b, ray.w_c, hn::Mul(ray.d_c, ray.w_b)), inverse_d2),
          hn::Mul(hn::MulSub(ray.d_c, ray.w_a, hn::Mul(ray.d_a, ray.w_c)), inverse_d2)};
}
// The square that a texture covers.
HWY_INLINE M insideTexture(const LocalPoint& at) {
  const V extent = set(kTextureExtent);
  return hn::And(hn::Le(hn::Abs(at.u), extent), hn::Le(hn::Abs(at.v), extent));
}
// TextureOutside::clip: leaves the lanes on the texture, and the samples that have some. Out of line, as it is not the
// usual treatment.
inline HWY_NOINLINE void clipToTexture(const Splat& s, const Rows& rows, int tile_x, Samples& samples) {
  int n = 0;
  for (int i = 0; i < samples.count; ++i) {
    const int block = samples.block[i];
    const V x = columnX(s, tile_x, block / kTileHeight);
    const LocalRay ray = localRay(s, rows.y[block % kTileHeight], x);
    const M inside = insideTexture(localPoint(ray, hn::Load(df, samples.at[i].inverse_d2)));
    const V value = hn::IfThenElseZero(inside, hn::Load(df, samples.at[i].value));
    if (hn::AllFalse(df, hn::Gt(value, hn::Zero(df)))) {
      samples.set.words[block / 64] &= ~(std::uint64_t{1} << block % 64);
      continue;
    }
    if (n != i) samples.at[n] = samples.at[i];
    hn::Store(value, df, samples.at[n].value);
    samples.block[n++] = block;
  }
  samples.count = n;
}

// TextureOutside::edge: texel coordinates of the border's nearest point. last_cell: Texture::last_u or last_v.
HWY_INLINE V onBorder(V texel, float last_cell) { return hn::Max(hn::Zero(df), hn::Min(texel, set(last_cell + 1.0f))); }

// kEdge: TextureOutside::edge, where the texture applies to all candidates.
template <bool kEdge = false>
HWY_INLINE TexturePoint locate(const Texture& texture, const LocalRay& ray, V inverse_d2, M candidates) {
  const LocalPoint point = localPoint(ray, inverse_d2);
  TexturePoint at;
  at.u = point.u;
  at.v = point.v;
  at.inside = kEdge ? candidates : hn::And(candidates, insideTexture(point));
  const V extent = set(kTextureExtent);
  V texel_u = hn::Mul(hn::Add(at.u, extent), set(texture.texels_per_sigma_u));
  V texel_v = hn::Mul(hn::Add(at.v, extent), set(texture.texels_per_sigma_v));
  if constexpr (kEdge) {
    texel_u = onBorder(texel_u, texture.last_u);
    texel_v = onBorder(texel_v, texture.last_v);
  }
  const V cell_u = hn::Min(hn::Floor(texel_u), set(texture.last_u));
  const V cell_v = hn::Min(hn::Floor(texel_v), set(texture.last_v));
  at.fraction_u = hn::Sub(texel_u, cell_u);
  at.fraction_v = hn::Sub(texel_v, cell_v);
  at.cell = hn::Add(hn::ConvertTo(di, cell_u),
                    hn::Mul(hn::ConvertTo(di, cell_v), hn::Set(di, static_cast<std::int32_t>(texture.width))));
  return at;
}

// Bilinear weights of the corners (i0, j0), (i1, j0), (i0, j1), (i1, j1).
struct Corners {
  V weight[4];
};
HWY_INLINE Corners cornerWeights(const TexturePoint& at) {
  const V one = set(1.0f);
  const V rest_u = hn::Sub(one, at.fraction_u);
  const V rest_v = hn::Sub(one, at.fraction_v);
  return {{hn::Mul(rest_u, rest_v), hn::Mul(at.fraction_u, rest_v), hn::Mul(rest_u, at.fraction_v),
           hn::Mul(at.fraction_u, at.fraction_v)}};
}
HWY_INLINE std::ptrdiff_t cornerStep(const Texture& texture, int corner) {
  return (corner & 1 ? texture.step_u : 0) + (corner & 2 ? texture.step_v : 0);
}

// Calls visit(first_float_of_the_cell, lanes) for every distinct cell of the lanes inside.
template <typename Visit>
HWY_INLINE void forEachCell(const TexturePoint& at, const Visit& visit) {
  std::uint32_t left = bitsOf(at.inside);
  alignas(64) std::int32_t cells[kLanes];
  hn::Store(at.cell, di, cells);
  while (left != 0) {
    const std::int32_t cell = cells[hwy::Num0BitsBelowLS1Bit_Nonzero32(left)];
    const M lanes = hn::And(at.inside, hn::RebindMask(df, hn::Eq(at.cell, hn::Set(di, cell))));
    visit(std::size_t{4} * static_cast<std::uint32_t>(cell), lanes);
    left &= ~bitsOf(lanes);
  }
}

// Alpha below the cut does not count.
HWY_INLINE V cutAlpha(V alpha) { return hn::IfThenElseZero(hn::Ge(alpha, set(kAlphaMin)), alpha); }

// The texture's alpha factor from its interpolated deviation from 1: neutral texels give exactly 1 whatever the
// weights' rounding, so that adding them leaves a picture the same to the last bit. 1 outside.
HWY_INLINE V alphaFactor(M inside, V deviation) { return hn::Add(set(1.0f), hn::IfThenElseZero(inside, deviation)); }

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
