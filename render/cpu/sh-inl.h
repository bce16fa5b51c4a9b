// SPDX-License-Identifier: Apache-2.0
// Real spherical harmonics to degree 3 for a batch of directions, and their gradient.
#include "render/cpu/geometry-inl.h"
#include "render/cpu/sh_basis-inl.h"

#if defined(TG_RENDER_CPU_SH_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TG_RENDER_CPU_SH_INL_H
#undef TG_RENDER_CPU_SH_INL_H
#else
#define TG_RENDER_CPU_SH_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {

using VB = hn::Vec<BatchFloats>;

// Directions of a batch from the camera to the means, world space.
struct Directions {
  V3 unit;
  VD distance;
  VB x, y, z;  // unit
};
HWY_INLINE Directions directionsTo(const View& view, V3 mean) {
  Directions d;
  const glm::dvec3 eye = view.eye;
  const V3 offset = subtract(mean, {splat(eye.x), splat(eye.y), splat(eye.z)});
  d.distance = length(offset);
  d.unit = scaled(offset, hn::Div(splat(1.0), d.distance));
  d.x = hn::DemoteTo(dbf, d.unit.x);
  d.y = hn::DemoteTo(dbf, d.unit.y);
  d.z = hn::DemoteTo(dbf, d.unit.z);
  return d;
}

// Basis functions [0, count) of every direction; [coefficient][lane].
struct ShBasis {
  alignas(64) float at[kShMax][kBatch];
};
HWY_INLINE void shBasis(const Directions& direction, int count, ShBasis& out) {
  shBasis(dbf, direction.x, direction.y, direction.z, count, out.at[0]);
}

// sum over coefficients of weights[k] grad Y_k, the direction taken as three free variables.
struct VB3 {
  VB x, y, z;
};
HWY_INLINE VB3 shGradient(const Directions& direction, int count, const ShBasis& weights) {
  const VB x = direction.x, y = direction.y, z = direction.z;
  VB3 g = {hn::Zero(dbf), hn::Zero(dbf), hn::Zero(dbf)};
  const auto weight = [&](int k, float factor)
                          HWY_ATTR { return hn::Mul(hn::Set(dbf, factor), hn::Load(dbf, weights.at[k])); };
  const auto twice = [](VB a) HWY_ATTR { return hn::Add(a, a); };
  if (count <= 1) return g;
  g.y = weight(1, -0.4886025119029199f);
  g.z = weight(2, 0.4886025119029199f);
  g.x = weight(3, -0.4886025119029199f);
  if (count <= 4) return g;
  const VB w4 = weight(4, 1.0925484305920792f), w5 = weight(5, -1.0925484305920792f);
  const VB w6 = weight(6, 2 * 0.31539156525252005f), w7 = weight(7, -1.0925484305920792f);
  const VB w8 = weight(8, 2 * 0.5462742152960396f);
  g.x = hn::Add(g.x, hn::MulAdd(w4, y, hn::MulAdd(w7, z, hn::Mul(hn::Sub(w8, w6), x))));
  g.y = hn::Add(g.y, hn::MulAdd(w4, x, hn::NegMulAdd(hn::Add(w6, w8), y, hn::Mul(w5, z))));
  g.z = hn::Add(g.z, hn::MulAdd(w5, y, hn::MulAdd(w7, x, hn::Mul(twice(w6), z))));
  if (count <= 9) return g;
  const VB xx = hn::Mul(x, x), yy = hn::Mul(y, y), zz = hn::Mul(z, z);
  const VB xy = hn::Mul(x, y), xz = hn::Mul(x, z), yz = hn::Mul(y, z);
  const VB xx_yy = hn::Sub(xx, yy);
  const VB three = hn::Set(dbf, 3.0f);
  const VB four_zz = hn::Mul(hn::Set(dbf, 4.0f), zz);
  const VB w9 = weight(9, 3 * -0.5900435899266435f), w10 = weight(10, 2.890611442640554f);
  const VB w11 = weight(11, -0.4570457994644658f), w12 = weight(12, 3 * 0.3731763325901154f);
  const VB w13 = weight(13, -0.4570457994644658f), w14 = weight(14, 1.445305721320277f);
  const VB w15 = weight(15, 3 * -0.5900435899266435f);
  const VB three_xx_yy = hn::MulAdd(three, xx, yy);  // 3 x^2 + y^2
  const VB three_yy_xx = hn::MulAdd(three, yy, xx);
  g.x = hn::Add(g.x, hn::MulAdd(w9, twice(xy), hn::MulAdd(w10, yz, hn::Mul(w11, hn::Neg(twice(xy))))));
  g.x = hn::Add(
      g.x, hn::MulAdd(w12, hn::Neg(twice(xz)),
                      hn::MulAdd(w13, hn::Sub(four_zz, three_xx_yy), hn::MulAdd(w14, twice(xz), hn::Mul(w15, xx_yy)))));
  g.y = hn::Add(g.y, hn::MulAdd(w9, xx_yy, hn::MulAdd(w10, xz, hn::Mul(w11, hn::Sub(four_zz, three_yy_xx)))));
  g.y = hn::Sub(
      g.y, hn::MulAdd(w12, twice(yz), hn::MulAdd(w13, twice(xy), hn::MulAdd(w14, twice(yz), hn::Mul(w15, twice(xy))))));
  const VB eight = hn::Set(dbf, 8.0f);
  g.z = hn::Add(g.z, hn::MulAdd(w10, xy, hn::Mul(w11, hn::Mul(eight, yz))));
  g.z = hn::Add(g.z, hn::MulAdd(w12, hn::Sub(hn::Sub(twice(zz), xx), yy),
                                hn::MulAdd(w13, hn::Mul(eight, xz), hn::Mul(w14, xx_yy))));
  return g;
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
