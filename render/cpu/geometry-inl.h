// SPDX-License-Identifier: Apache-2.0
// A batch of Gaussians as a camera sees them, one a lane, in double precision: what the pixel loops' records and the
// backward pass's chain rule start from. Names as in shaders/shared/splat.h; local axes in the order (a, b, c).
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/cpu/project.h"

// Compiled once per target: not `#pragma once`.
#if defined(TG_RENDER_CPU_GEOMETRY_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef TG_RENDER_CPU_GEOMETRY_INL_H
#undef TG_RENDER_CPU_GEOMETRY_INL_H
#else
#define TG_RENDER_CPU_GEOMETRY_INL_H
#endif

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Doubles = HWY_CAPPED(double, 8);
using BatchFloats = hn::Rebind<float, Doubles>;
using VD = hn::Vec<Doubles>;
using MD = hn::Mask<Doubles>;
constexpr Doubles dd;
constexpr BatchFloats dbf;
constexpr int kBatch = static_cast<int>(hn::MaxLanes(Doubles()));

HWY_INLINE VD splat(double value) { return hn::Set(dd, value); }

struct V3 {
  VD x, y, z;
};
HWY_INLINE V3 add(V3 a, V3 b) { return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)}; }
HWY_INLINE V3 subtract(V3 a, V3 b) { return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)}; }
HWY_INLINE V3 scaled(V3 a, VD s) { return {hn::Mul(a.x, s), hn::Mul(a.y, s), hn::Mul(a.z, s)}; }
HWY_INLINE V3 product(V3 a, V3 b) { return {hn::Mul(a.x, b.x), hn::Mul(a.y, b.y), hn::Mul(a.z, b.z)}; }
// a s + b
HWY_INLINE V3 addScaled(V3 a, VD s, V3 b) {
  return {hn::MulAdd(a.x, s, b.x), hn::MulAdd(a.y, s, b.y), hn::MulAdd(a.z, s, b.z)};
}
HWY_INLINE VD dot(V3 a, V3 b) { return hn::MulAdd(a.z, b.z, hn::MulAdd(a.y, b.y, hn::Mul(a.x, b.x))); }
HWY_INLINE V3 cross(V3 a, V3 b) {
  return {hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)),
          hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x))};
}
HWY_INLINE VD length(V3 a) { return hn::Sqrt(dot(a, a)); }
HWY_INLINE V3 select(MD mask, V3 yes, V3 no) {
  return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y), hn::IfThenElse(mask, yes.z, no.z)};
}
HWY_INLINE V3 zero3() { return {hn::Zero(dd), hn::Zero(dd), hn::Zero(dd)}; }
// a / |a|, zero for the zero vector.
HWY_INLINE V3 unitOrZero(V3 a) {
  const VD l = length(a);
  const MD positive = hn::Gt(l, hn::Zero(dd));
  return scaled(a, hn::IfThenElseZero(positive, hn::Div(splat(1.0), hn::IfThenElse(positive, l, splat(1.0)))));
}
// m a for a matrix that all lanes share, and its transpose times a.
HWY_INLINE V3 transform(const glm::dmat3& m, V3 a) {
  V3 r[3];
  for (int row = 0; row < 3; ++row) {
    r[row].x = hn::MulAdd(splat(m[2][row]), a.z, hn::MulAdd(splat(m[1][row]), a.y, hn::Mul(splat(m[0][row]), a.x)));
  }
  return {r[0].x, r[1].x, r[2].x};
}

// Stored parameters of a batch.
struct Batch {
  V3 mean;  // world space
  V3 log_scale;
  VD rotation[4];
};
HWY_INLINE Batch loadBatch(const GaussianModel& model, const std::uint32_t* gaussians) {
  alignas(64) double rows[10][kBatch];
  for (int lane = 0; lane < kBatch; ++lane) {
    const std::uint32_t i = gaussians[lane];
    for (int k = 0; k < 3; ++k) {
      rows[k][lane] = model.mean[i][k];
      rows[3 + k][lane] = model.log_scale[i][k];
    }
    for (int k = 0; k < 4; ++k) rows[6 + k][lane] = model.rotation[i][k];
  }
  const auto row = [&](int k) HWY_ATTR { return hn::Load(dd, rows[k]); };
  return {{row(0), row(1), row(2)}, {row(3), row(4), row(5)}, {row(6), row(7), row(8), row(9)}};
}

struct Geometry {
  MD shortest_0, shortest_1, shortest_2;  // which stored axis c is
  V3 mean_c;                              // camera space
  V3 scale;                               // of a, b, c [world units], after splat_scale and antialiasing
  VD opacity_factor;                      // that goes with antialiasing
  V3 axes_c[3];                           // local axes in camera space
  V3 m[3];                                // columns of local_from_camera, in sigma
  V3 dx, dy, d0;                          // D(x, y) = dx x + dy y + d0; the camera in the local frame is -mean_c.z d0
  // What the power reads of D and W, divided by |d0|: the plane model drops D_a, D_b and W_c, with which both models
  // are p = (D x W) / |D|^2.
  VD unit;        // 1 / |d0|
  V3 power_d[3];  // dx, dy, d0
  V3 power_w[2];  // wx, wy
  // Moving the projected mean by (1, 0) px at one depth changes W at a pixel by -(wx + kappa y), by (0, 1) px by
  // -(wy - kappa x).
  V3 kappa;
  // Triangular factors: |W|^2 = (w_xx x + w_xy y)^2 + (w_yy y)^2, |D|^2 = (d_xx x + d_xy y + d_x1)^2 + (d_yy y +
  // d_y1)^2 + d_11^2. They keep sums of squares, so nothing cancels but the linear terms themselves.
  VD w_xx, w_xy, w_yy;
  VD d_xx, d_xy, d_x1, d_yy, d_y1, d_11;
  V3 w_first;  // unit vector: W = w_first (w_xx x + w_xy y) + w_second y
  V3 w_second;
};

HWY_INLINE void rotationColumns(const VD* raw, V3* columns) {
  const VD squared =
      hn::MulAdd(raw[0], raw[0], hn::MulAdd(raw[1], raw[1], hn::MulAdd(raw[2], raw[2], hn::Mul(raw[3], raw[3]))));
  const VD inverse = hn::Div(splat(1.0), hn::Sqrt(squared));
  const VD w = hn::Mul(raw[0], inverse), x = hn::Mul(raw[1], inverse);
  const VD y = hn::Mul(raw[2], inverse), z = hn::Mul(raw[3], inverse);
  const auto twice = [](VD a) HWY_ATTR { return hn::Add(a, a); };
  const VD xx = hn::Mul(x, x), yy = hn::Mul(y, y), zz = hn::Mul(z, z);
  const VD xy = hn::Mul(x, y), xz = hn::Mul(x, z), yz = hn::Mul(y, z);
  const VD wx = hn::Mul(w, x), wy = hn::Mul(w, y), wz = hn::Mul(w, z);
  const VD one = splat(1.0);
  columns[0] = {hn::Sub(one, twice(hn::Add(yy, zz))), twice(hn::Add(xy, wz)), twice(hn::Sub(xz, wy))};
  columns[1] = {twice(hn::Sub(xy, wz)), hn::Sub(one, twice(hn::Add(xx, zz))), twice(hn::Add(yz, wx))};
  columns[2] = {twice(hn::Add(xz, wy)), twice(hn::Sub(yz, wx)), hn::Sub(one, twice(hn::Add(xx, yy)))};
}

// docs/math.md 1.4
HWY_INLINE void antialias(const View& view, Geometry& g) {
  const VD pixel = hn::Div(g.mean_c.z, splat(std::max(view.focal.x, view.focal.y)));
  const VD add_variance = hn::Mul(splat(kScreenVariance), hn::Mul(pixel, pixel));
  const auto wider = [&](VD s) HWY_ATTR { return hn::Sqrt(hn::MulAdd(s, s, add_variance)); };
  const V3 scale = {wider(g.scale.x), wider(g.scale.y), wider(g.scale.z)};
  g.opacity_factor = hn::Mul(hn::Div(g.scale.x, scale.x), hn::Div(g.scale.y, scale.y));
  if (view.antialias_for == IntersectionModel::maxResponse) {
    const auto over = [](VD a, VD b) HWY_ATTR { return hn::Div(a, b); };
    const V3 along = {dot(g.axes_c[0], g.mean_c), dot(g.axes_c[1], g.mean_c), dot(g.axes_c[2], g.mean_c)};
    const VD before = length({over(along.x, g.scale.x), over(along.y, g.scale.y), over(along.z, g.scale.z)});
    const VD after = length({over(along.x, scale.x), over(along.y, scale.y), over(along.z, scale.z)});
    g.opacity_factor = hn::Mul(g.opacity_factor, hn::Mul(over(g.scale.z, scale.z), over(before, after)));
  }
  g.scale = scale;
}

HWY_INLINE Geometry makeGeometry(const View& view, const Batch& batch) {
  Geometry g;
  const bool plane = view.intersection == IntersectionModel::plane;
  const VD zero = hn::Zero(dd);

  // The shortest axis, the lowest index on ties; a and b are the other two in index order.
  const V3 ls = batch.log_scale;
  const MD one_shorter = hn::Lt(ls.y, ls.x);
  g.shortest_2 = hn::Lt(ls.z, hn::IfThenElse(one_shorter, ls.y, ls.x));
  g.shortest_1 = hn::AndNot(g.shortest_2, one_shorter);
  g.shortest_0 = hn::Not(hn::Or(g.shortest_2, g.shortest_1));
  V3 columns[3];
  rotationColumns(batch.rotation, columns);
  for (V3& column : columns) column = transform(view.rotation, column);
  g.axes_c[0] = select(g.shortest_0, columns[1], columns[0]);
  g.axes_c[1] = select(g.shortest_2, columns[1], columns[2]);
  g.axes_c[2] = select(g.shortest_2, columns[2], select(g.shortest_1, columns[1], columns[0]));
  VD scale[3] = {hn::Exp(dd, ls.x), hn::Exp(dd, ls.y), hn::Exp(dd, ls.z)};
  const VD most = hn::Max(scale[0], hn::Max(scale[1], scale[2]));
  const VD longest = hn::Min(most, splat(double{kScaleMax} / view.splat_scale));
  const VD thinnest = hn::Mul(splat(kThinnest), longest);
  for (VD& s : scale) s = hn::Min(hn::Max(s, thinnest), longest);
  g.scale.x = hn::IfThenElse(g.shortest_0, scale[1], scale[0]);
  g.scale.y = hn::IfThenElse(g.shortest_2, scale[1], scale[2]);
  g.scale.z = hn::IfThenElse(g.shortest_2, scale[2], hn::IfThenElse(g.shortest_1, scale[1], scale[0]));
  if (view.splat_scale != 1.0f) g.scale = scaled(g.scale, splat(view.splat_scale));

  const glm::dvec3 t = view.translation;
  g.mean_c = add(transform(view.rotation, batch.mean), {splat(t.x), splat(t.y), splat(t.z)});
  g.opacity_factor = splat(1.0);
  if (view.antialias) antialias(view, g);
  const V3 inverse = {hn::Div(splat(1.0), g.scale.x), hn::Div(splat(1.0), g.scale.y), hn::Div(splat(1.0), g.scale.z)};
  g.m[0] = product(inverse, {g.axes_c[0].x, g.axes_c[1].x, g.axes_c[2].x});
  g.m[1] = product(inverse, {g.axes_c[0].y, g.axes_c[1].y, g.axes_c[2].y});
  g.m[2] = product(inverse, {g.axes_c[0].z, g.axes_c[1].z, g.axes_c[2].z});
  const VD z = g.mean_c.z;
  const VD inverse_z = hn::Div(splat(1.0), z);
  g.dx = scaled(g.m[0], splat(1.0 / view.focal.x));
  g.dy = scaled(g.m[1], splat(1.0 / view.focal.y));
  g.d0 = addScaled(g.m[0], hn::Mul(g.mean_c.x, inverse_z), addScaled(g.m[1], hn::Mul(g.mean_c.y, inverse_z), g.m[2]));

  g.unit = hn::Div(splat(1.0), length(g.d0));
  g.power_d[0] = scaled(g.dx, g.unit);
  g.power_d[1] = scaled(g.dy, g.unit);
  g.power_d[2] = scaled(g.d0, g.unit);
  const VD unit_z = hn::Mul(g.unit, z);
  g.power_w[0] = scaled(cross(g.dx, g.d0), unit_z);  // o = -z d0
  g.power_w[1] = scaled(cross(g.dy, g.d0), unit_z);
  g.kappa = scaled(cross(g.dx, g.dy), unit_z);
  if (plane) {
    for (V3& d : g.power_d) d.x = d.y = zero;
    for (V3& w : g.power_w) w.z = zero;
    g.kappa.z = zero;
  }
  g.w_first = unitOrZero(g.power_w[0]);
  g.w_xx = length(g.power_w[0]);
  g.w_xy = dot(g.w_first, g.power_w[1]);
  g.w_second = subtract(g.power_w[1], scaled(g.w_first, g.w_xy));
  g.w_yy = length(g.w_second);
  // The plane model's D has one entry, D_c; a splat that faces the camera squarely has no dx in it.
  const V3 first = plane ? V3{zero, zero, splat(1.0)} : unitOrZero(g.power_d[0]);
  g.d_xx = dot(first, g.power_d[0]);
  g.d_xy = dot(first, g.power_d[1]);
  g.d_x1 = dot(first, g.power_d[2]);
  if (plane) {
    // All of D but its first row is rounding noise of the subtraction; it must not outweigh D_c = 0.
    g.d_yy = g.d_y1 = g.d_11 = zero;
  } else {
    const V3 rest_y = subtract(g.power_d[1], scaled(first, g.d_xy));
    const V3 rest_1 = subtract(g.power_d[2], scaled(first, g.d_x1));
    const V3 second = unitOrZero(rest_y);
    g.d_yy = length(rest_y);
    g.d_y1 = dot(second, rest_1);
    g.d_11 = length(subtract(rest_1, scaled(second, g.d_y1)));
  }
  return g;
}

}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
