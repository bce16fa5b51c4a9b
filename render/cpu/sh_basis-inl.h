// SPDX-License-Identifier: Apache-2.0
// Real spherical harmonics to degree 3 for a vector of directions; the numbers are shaders/shared/sh.h's.
#include <hwy/highway.h>

#include <cstddef>

// Compiled once per target: not `#pragma once`.
#if defined(TG_RENDER_CPU_SH_BASIS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TG_RENDER_CPU_SH_BASIS_INL_H
#undef TG_RENDER_CPU_SH_BASIS_INL_H
#else
#define TG_RENDER_CPU_SH_BASIS_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kShMax = 16;  // functions

// Functions [0, count) of unit directions, function k at out + k * lanes. out: aligned, for kShMax functions.
template <class Tag, class Vec>
HWY_INLINE void shBasis(Tag d, Vec x, Vec y, Vec z, int count, float* out) {
  const auto put = [&](int k, float factor, Vec value) HWY_ATTR {
    hn::Store(hn::Mul(hn::Set(d, factor), value), d, out + static_cast<std::size_t>(k) * hn::MaxLanes(Tag()));
  };
  put(0, 0.28209479177387814f, hn::Set(d, 1.0f));
  if (count <= 1) return;
  put(1, -0.4886025119029199f, y);
  put(2, 0.4886025119029199f, z);
  put(3, -0.4886025119029199f, x);
  if (count <= 4) return;
  const Vec xx = hn::Mul(x, x), yy = hn::Mul(y, y), zz = hn::Mul(z, z);
  const Vec xy = hn::Mul(x, y);
  const Vec xx_yy = hn::Sub(xx, yy);
  put(4, 1.0925484305920792f, xy);
  put(5, -1.0925484305920792f, hn::Mul(y, z));
  put(6, 0.31539156525252005f, hn::Sub(hn::Sub(hn::Add(zz, zz), xx), yy));
  put(7, -1.0925484305920792f, hn::Mul(x, z));
  put(8, 0.5462742152960396f, xx_yy);
  if (count <= 9) return;
  const Vec three = hn::Set(d, 3.0f);
  const Vec four_zz = hn::Sub(hn::Sub(hn::Mul(hn::Set(d, 4.0f), zz), xx), yy);
  put(9, -0.5900435899266435f, hn::Mul(y, hn::MulSub(three, xx, yy)));
  put(10, 2.890611442640554f, hn::Mul(xy, z));
  put(11, -0.4570457994644658f, hn::Mul(y, four_zz));
  put(12, 0.3731763325901154f, hn::Mul(z, hn::NegMulAdd(three, hn::Add(xx, yy), hn::Add(zz, zz))));
  put(13, -0.4570457994644658f, hn::Mul(x, four_zz));
  put(14, 1.445305721320277f, hn::Mul(z, xx_yy));
  put(15, -0.5900435899266435f, hn::Mul(x, hn::NegMulAdd(three, yy, xx)));
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
