// SPDX-License-Identifier: Apache-2.0
// Where a hit falls on a Gaussian's texture: four texels and their weights (paper: bilinear over +-3 sigma).
#ifndef TG_TEXTURE_H
#define TG_TEXTURE_H
#include "shared/limits.h"
TG_NAMESPACE_BEGIN

// One axis: texel 0 sits ON -3 sigma, texel size-1 ON +3 sigma (corner aligned). A one-texel axis is constant.
struct TextureTap {
  uint i0;
  uint i1;         // min(i0 + 1, size - 1)
  float fraction;  // weight of i1
};

// Scale from sigma to texels: d(texel coordinate) / d(u).
TG_FN float texelsPerSigma(uint size) { return float(size - 1u) / (2.0f * kTextureExtent); }

// u in [-kTextureExtent, kTextureExtent]; size >= 1.
TG_FN TextureTap textureTap(float u, uint size) {
  float x = (u + kTextureExtent) * texelsPerSigma(size);
  uint last = size >= 2u ? size - 2u : 0u;
  float cell = clamp(floor(x), 0.0f, float(last));
  TextureTap tap;
  tap.i0 = uint(cell);
  tap.i1 = min(tap.i0 + 1u, size - 1u);
  tap.fraction = x - cell;
  return tap;
}

// The closed square that a texture covers.
TG_FN bool insideTexture(vec2 uv) {
  return uv.x >= -kTextureExtent && uv.x <= kTextureExtent && uv.y >= -kTextureExtent && uv.y <= kTextureExtent;
}

// Whether a hit at `uv` samples the texture, and where: `outside` (kOutside*) may move it onto the border. Where it
// does not, kOutsideBase leaves the base alone and kOutsideClip nothing (docs/math.md 3).
TG_FN bool samplesTexture(uint outside, TG_INOUT(vec2) uv) {
  if (outside == kOutsideEdge) {
    uv = vec2(clamp(uv.x, -kTextureExtent, kTextureExtent), clamp(uv.y, -kTextureExtent, kTextureExtent));
  }
  return insideTexture(uv);
}

TG_NAMESPACE_END
#endif
