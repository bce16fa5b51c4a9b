// SPDX-License-Identifier: Apache-2.0
// A texture at all samples of a splat in a tile: what the forward pixel loops blend.
#include "render/cpu/texture_cells-inl.h"
#include "shared/splat.h"

#if defined(TG_RENDER_CPU_TEXTURE_SAMPLES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TG_RENDER_CPU_TEXTURE_SAMPLES_INL_H
#undef TG_RENDER_CPU_TEXTURE_SAMPLES_INL_H
#else
#define TG_RENDER_CPU_TEXTURE_SAMPLES_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {

// What the footprint filter leaves of a texture's taps is 1 - share; value: share times the texture's mean, alpha as a
// deviation from 1.
struct TextureMean {
  float share = 0.0f;
  glm::vec4 value{0.0f};
};
// s: a Splat or a PictureHit.
template <class S>
HWY_INLINE TextureMean textureMean(const S& s, const Texels& texels, const View& view) {
  const float share = view.footprint ? footprintShare(s.texel_density) : 0.0f;
  if (!(share > 0.0f)) return {};
  return {share, share * (texels.means[s.gaussian] - glm::vec4(0, 0, 0, 1))};
}

struct TextureSamples {
  alignas(64) float color[kBlocks][3][kLanes];  // 0 where it does not apply
  CellSamples cells;                            // of small textures
  CellCoefficients coefficients;

  TextureSamples() { clear(coefficients); }
};

// applyTexture() for a small texture, unfiltered.
template <bool kEdge>
HWY_INLINE void applySmall(const Splat& s, const Texels& texels, const View& view, int tile_x, int tile_y,
                           Samples& samples, TextureSamples& colors) {
  const Texture texture = makeTexture(s, texels.texels);
  TileRays rays;
  fillRays(s, s, tile_x, tile_y, rowRange(s, tile_y), rays);
  locateCells<false, kEdge>(texture, rays, samples, colors.cells);
  CellCoefficients& coefficients = colors.coefficients;
  fillCells(texture, colors.cells.touched, view.texture_rgb, view.texture_alpha, coefficients);
  const auto put = [&](int i, const V* look) HWY_ATTR {
    float* value = samples.at[i].value;
    for (int ch = 0; ch < 3; ++ch) hn::Store(look[ch], df, colors.color[i][ch]);
    hn::Store(cutAlpha(hn::Mul(hn::Load(df, value), hn::Add(look[3], set(1.0f)))), df, value);
  };
  for (int k = 0; k < colors.cells.uniform_count; ++k) {
    const int i = colors.cells.uniform[k], cell = colors.cells.uniform_cell[k];
    const CellSample& at = colors.cells.at[i];
    const V u = hn::Load(df, at.fraction_u), v = hn::Load(df, at.fraction_v);
    V look[4];
    for (int ch = 0; ch < 4; ++ch) look[ch] = cellValue(coefficients, cell, ch, u, v);
    put(i, look);
  }
  for (int k = 0; k < colors.cells.mixed_count; ++k) {
    const int i = colors.cells.mixed[k];
    const CellSample& at = colors.cells.at[i];
    const V u = hn::Load(df, at.fraction_u), v = hn::Load(df, at.fraction_v);
    V look[4] = {hn::Zero(df), hn::Zero(df), hn::Zero(df), hn::Zero(df)};
    forEachCell(at, colors.cells.lanes[i], [&](int cell, M lanes) HWY_ATTR {
      for (int ch = 0; ch < 4; ++ch) {
        look[ch] = hn::IfThenElse(lanes, cellValue(coefficients, cell, ch, u, v), look[ch]);
      }
    });
    put(i, look);
  }
}

// applyTexture() of TextureOutside::edge, or of base.
template <bool kEdge>
HWY_INLINE void sampleTexture(const Splat& s, const Texels& texels, const View& view, const Rows& rows, int tile_x,
                              int tile_y, Samples& samples, TextureSamples& colors) {
  const Texture texture = makeTexture(s, texels.texels);
  const TextureMean mean = textureMean(s, texels, view);
  if (isSmall(s) && !(mean.share > 0.0f)) {
    applySmall<kEdge>(s, texels, view, tile_x, tile_y, samples, colors);
    return;
  }
  for (int i = 0; i < samples.count; ++i) {
    Sample& sample = samples.at[i];
    const V x = columnX(s, tile_x, samples.block[i] / kTileHeight);
    const V value = hn::Load(df, sample.value);
    const TexturePoint at = locate<kEdge>(texture, localRay(s, rows.y[samples.row(i)], x),
                                          hn::Load(df, sample.inverse_d2), hn::Gt(value, hn::Zero(df)));
    V color[3] = {hn::Zero(df), hn::Zero(df), hn::Zero(df)};
    V alpha = hn::Zero(df);
    if (mean.share < 1.0f) {
      const Corners corners = cornerWeights(at);
      forEachCell(at, [&](std::size_t cell, M lanes) HWY_ATTR {
        for (int k = 0; k < 4; ++k) {
          const float* texel = texture.texels + cell + cornerStep(texture, k);
          const V weight = hn::IfThenElseZero(lanes, corners.weight[k]);
          if (view.texture_rgb) {
            for (int ch = 0; ch < 3; ++ch) color[ch] = hn::MulAdd(weight, set(texel[ch]), color[ch]);
          }
          alpha = hn::MulAdd(weight, set(texel[3] - 1.0f), alpha);
        }
      });
    }
    if (mean.share > 0.0f) {
      const V sharp = set(1.0f - mean.share);
      for (int ch = 0; ch < 3 && view.texture_rgb; ++ch) {
        color[ch] = hn::MulAdd(sharp, color[ch], hn::IfThenElseZero(at.inside, set(mean.value[ch])));
      }
      alpha = hn::MulAdd(sharp, alpha, set(mean.value.a));
    }
    for (int ch = 0; ch < 3; ++ch) hn::Store(color[ch], df, colors.color[i][ch]);
    if (view.texture_alpha) hn::Store(cutAlpha(hn::Mul(value, alphaFactor(at.inside, alpha))), df, sample.value);
  }
}

// applyTexture() of what is not the usual treatment. Out of line: callers stay as short as without it.
template <TextureOutside kOutside>
HWY_NOINLINE void applyTextureAs(const Splat& s, const Texels& texels, const View& view, const Rows& rows, int tile_x,
                                 int tile_y, Samples& samples, TextureSamples& colors) {
  if constexpr (kOutside == TextureOutside::clip) clipToTexture(s, rows, tile_x, samples);
  sampleTexture<kOutside == TextureOutside::edge>(s, texels, view, rows, tile_x, tile_y, samples, colors);
}

// Fills `colors`, multiplies the values of `samples` by the alpha factor and drops what falls below the cut.
HWY_INLINE void applyTexture(const Splat& s, const Texels& texels, const View& view, const Rows& rows, int tile_x,
                             int tile_y, Samples& samples, TextureSamples& colors) {
  switch (view.outside) {
    case TextureOutside::base:
      return sampleTexture<false>(s, texels, view, rows, tile_x, tile_y, samples, colors);
    case TextureOutside::clip:
      return applyTextureAs<TextureOutside::clip>(s, texels, view, rows, tile_x, tile_y, samples, colors);
    case TextureOutside::edge:
      return applyTextureAs<TextureOutside::edge>(s, texels, view, rows, tile_x, tile_y, samples, colors);
  }
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
