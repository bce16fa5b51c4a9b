// SPDX-License-Identifier: Apache-2.0
// A splat and its texture at a pixel: the scalar twin of render/cpu/kernel-inl.h and texture-inl.h.
#pragma once
#include "shared/texture.h"
#include "training/cuda/device.h"
#include "training/cuda/types.h"

namespace tg::cuda {

// (x, y): pixel - centre [px].
struct Sample {
  float x, y;
  float value;  // opacity * G
  float w;      // first triangular component of W
  float inverse_d2;
  float q;  // |W|^2 / |D|^2
};

// What one load of 16 bytes reads, from where memory is aligned to them.
struct alignas(16) FourFloats {
  float value[4];
};
TG_DEVICE FourFloats loadFour(const float* from) { return *reinterpret_cast<const FourFloats*>(from); }

// False: the splat does not show there. Forward and backward pass must agree on that: every sum is an explicit fmaf, so
// that no compiler contracts it in one kernel and not in another.
TG_DEVICE bool evaluate(const BlendSplat& s, float pixel_x, float pixel_y, Sample& out) {
  out.x = pixel_x - s.center_x;
  out.y = pixel_y - s.center_y;
  out.w = ::fmaf(s.w_xx, out.x, s.w_xy * out.y);
  const float w2 = s.w_yy * out.y;
  const float d = ::fmaf(s.d_xx, out.x, ::fmaf(s.d_xy, out.y, s.d_x1));
  const float d2 = ::fmaf(s.d_yy, out.y, s.d_y1);
  out.inverse_d2 = reciprocal(::fmaf(d, d, ::fmaf(d2, d2, s.d_11 * s.d_11)));
  const float square = ::fmaf(out.w, out.w, w2 * w2);
  out.q = square * out.inverse_d2;
  out.value = ::exp2f(::fmaf(-square, out.inverse_d2, s.log2_opacity));
  if (!(out.value >= kAlphaMin)) return false;
  return s.near == 0.0f || ::fmaf(s.t_x, out.x, ::fmaf(s.t_y, out.y, s.t_1)) * out.inverse_d2 > s.near;
}

// A rectangle of pixel centres, its borders included [px].
struct PixelBlock {
  float left, top, right, bottom;
};
// False: evaluate() is false all over the block. |W| has its minimum where the block faces the splat's centre, on one of
// two edges or at the centre itself; no component of D is larger than in the block's middle by more than its slopes
// allow. What rounding may do is added to the limit.
TG_DEVICE bool mayShow(const BlendSplat& s, const PixelBlock& block) {
  constexpr float kSlack = 4e-6f;            // of W's terms, relative
  constexpr float kPowerMargin = 1e-4f;      // of the exponent
  constexpr float kLog2AlphaMin = -7.99435344f;
  const float x0 = block.left - s.center_x, x1 = block.right - s.center_x;
  const float y0 = block.top - s.center_y, y1 = block.bottom - s.center_y;
  const float near_x = min(max(0.0f, x0), x1), near_y = min(max(0.0f, y0), y1);
  // Of the row and of the column that face the centre: where no division is possible W does not depend on the place.
  const float x = min(max(-s.w_xy * near_y * reciprocal(s.w_xx), x0), x1);
  const float y = min(max(-s.w_xx * s.w_xy * near_x * reciprocal(s.w_xy * s.w_xy + s.w_yy * s.w_yy), y0), y1);
  const float row = s.w_xx * x + s.w_xy * near_y, row2 = s.w_yy * near_y;
  const float column = s.w_xx * near_x + s.w_xy * y, column2 = s.w_yy * y;
  const float least = min(row * row + row2 * row2, column * column + column2 * column2);

  const float middle_x = 0.5f * (x0 + x1), middle_y = 0.5f * (y0 + y1);
  const float half_x = 0.5f * (x1 - x0), half_y = 0.5f * (y1 - y0);
  const float d =
      ::fabsf(s.d_xx * middle_x + s.d_xy * middle_y + s.d_x1) + ::fabsf(s.d_xx) * half_x + ::fabsf(s.d_xy) * half_y;
  const float d2 = ::fabsf(s.d_yy * middle_y + s.d_y1) + s.d_yy * half_y;
  const float power = max(s.log2_opacity - kLog2AlphaMin, 0.0f) + kPowerMargin;
  const float rounding = s.w_xx * max(::fabsf(x0), ::fabsf(x1)) +
                         (::fabsf(s.w_xy) + s.w_yy) * max(::fabsf(y0), ::fabsf(y1));
  const float limit = ::sqrtf(power * (d * d + d2 * d2 + s.d_11 * s.d_11)) * (1.0f + kPowerMargin) + kSlack * rounding;
  return !(least > limit * limit);
}

// The components of W and D.
struct LocalRay {
  float w[3], d[3];
};
TG_DEVICE LocalRay localRay(const LocalFrame& f, float x, float y) {
  // Member by member the compiler would load four bytes at a time.
  const float* from = f.wx;
  const FourFloats a = loadFour(from), b = loadFour(from + 4), c = loadFour(from + 8), d = loadFour(from + 12);
  const float wx[3] = {a.value[0], a.value[1], a.value[2]}, wy[3] = {a.value[3], b.value[0], b.value[1]};
  const float dx[3] = {b.value[2], b.value[3], c.value[0]}, dy[3] = {c.value[1], c.value[2], c.value[3]};
  LocalRay ray;
  for (int k = 0; k < 3; ++k) {
    ray.w[k] = ::fmaf(wx[k], x, wy[k] * y);
    ray.d[k] = ::fmaf(dx[k], x, ::fmaf(dy[k], y, d.value[k]));
  }
  return ray;
}

// Where a sample falls on the texture: the four texels around it and their weights.
struct TexturePoint {
  bool inside;
  float u, v;  // [sigma]
  float fraction_u, fraction_v;
  std::uint32_t cell;            // texel index of the first corner, within the rectangle
  std::uint32_t step_u, step_v;  // [texels] to the next along u and v; 0 on a one-texel axis

  TG_DEVICE std::uint32_t corner(int k) const { return cell + (k & 1 ? step_u : 0) + (k & 2 ? step_v : 0); }
  TG_DEVICE float weight(int k) const {
    return (k & 1 ? fraction_u : 1.0f - fraction_u) * (k & 2 ? fraction_v : 1.0f - fraction_v);
  }
};
// outside: kOutside*
TG_DEVICE TexturePoint locate(const BlendSplat& s, const LocalRay& ray, float inverse_d2, std::uint32_t outside) {
  TexturePoint at;
  at.u = ::fmaf(ray.d[1], ray.w[2], -(ray.d[2] * ray.w[1])) * inverse_d2;
  at.v = ::fmaf(ray.d[2], ray.w[0], -(ray.d[0] * ray.w[2])) * inverse_d2;
  glm::vec2 uv(at.u, at.v);
  at.inside = samplesTexture(outside, uv);
  if (!at.inside) {
    at.fraction_u = at.fraction_v = 0.0f;
    at.cell = at.step_u = at.step_v = 0;
    return at;
  }
  const std::uint32_t width = s.texture_size & 0xffffu;
  const std::uint32_t height = s.texture_size >> 16;
  const TextureTap tap_u = textureTap(uv.x, width);
  const TextureTap tap_v = textureTap(uv.y, height);
  at.fraction_u = tap_u.fraction;
  at.fraction_v = tap_v.fraction;
  at.cell = tap_v.i0 * width + tap_u.i0;
  at.step_u = tap_u.i1 - tap_u.i0;
  at.step_v = (tap_v.i1 - tap_v.i0) * width;
  return at;
}

}  // namespace tg::cuda
