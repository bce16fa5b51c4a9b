// SPDX-License-Identifier: Apache-2.0
// The chain rule of a batch of Gaussians, in double precision: it runs once per visible Gaussian, not per pixel.
#include "training/cpu/finish.h"

#include <cstddef>
#include <numbers>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "training/cpu/finish.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "core/system/assert.h"
#include "render/cpu/geometry-inl.h"
#include "render/cpu/sh-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tg::cpu::HWY_NAMESPACE {
namespace {

// One float of every lane's sums.
struct SumsReader {
  std::span<const SplatSums> splats;

  HWY_INLINE VD get(float PairSums::* member, double factor) const {
    alignas(64) double lanes[kBatch] = {};
    for (std::size_t lane = 0; lane < splats.size(); ++lane) lanes[lane] = splats[lane].pairs.*member;
    return hn::Mul(hn::Load(dd, lanes), splat(factor));
  }
  HWY_INLINE VD get(float PairTextureSums::* member) const {
    alignas(64) double lanes[kBatch] = {};
    for (std::size_t lane = 0; lane < splats.size(); ++lane) lanes[lane] = splats[lane].texture.*member;
    return hn::Load(dd, lanes);
  }
};

// dL/dW and dL/dD summed against (x, y, 1): element j belongs to factor j.
struct RayGradient {
  V3 v_w[3];
  V3 v_d[3];
};

// The numerators of u and v are the first two components of D x W: with q = (u, v, 0) their gradients, dL/dD = W x q
// and dL/dW = q x D.
HWY_INLINE void addTexture(const Geometry& g, const SumsReader& sums, RayGradient& r) {
  const auto q = [&](float PairTextureSums::* u, float PairTextureSums::* v)
                     HWY_ATTR { return V3{sums.get(u), sums.get(v), hn::Zero(dd)}; };
  const V3 q_1 = q(&PairTextureSums::u, &PairTextureSums::v);
  const V3 q_x = q(&PairTextureSums::u_x, &PairTextureSums::v_x);
  const V3 q_y = q(&PairTextureSums::u_y, &PairTextureSums::v_y);
  const V3 q_xx = q(&PairTextureSums::u_xx, &PairTextureSums::v_xx);
  const V3 q_xy = q(&PairTextureSums::u_xy, &PairTextureSums::v_xy);
  const V3 q_yy = q(&PairTextureSums::u_yy, &PairTextureSums::v_yy);
  const V3 wx = g.power_w[0], wy = g.power_w[1];
  const V3 dx = g.power_d[0], dy = g.power_d[1], d0 = g.power_d[2];
  r.v_d[0] = add(r.v_d[0], add(cross(wx, q_xx), cross(wy, q_xy)));
  r.v_d[1] = add(r.v_d[1], add(cross(wx, q_xy), cross(wy, q_yy)));
  r.v_d[2] = add(r.v_d[2], add(cross(wx, q_x), cross(wy, q_y)));
  r.v_w[0] = add(r.v_w[0], add(cross(q_xx, dx), add(cross(q_xy, dy), cross(q_x, d0))));
  r.v_w[1] = add(r.v_w[1], add(cross(q_xy, dx), add(cross(q_yy, dy), cross(q_y, d0))));
  r.v_w[2] = add(r.v_w[2], add(cross(q_x, dx), add(cross(q_y, dy), cross(q_1, d0))));
}

HWY_INLINE RayGradient rayGradient(const View& view, const Geometry& g, const SumsReader& sums) {
  // dL/d|W|^2 = -ln 2 a in units of Splat's W, hence the factors; twice that is the factor of W.
  const double of_w = -2.0 * std::numbers::ln2 * kExponentScale;
  const double of_a = of_w * kExponentScale;
  const double of_b = 2.0 * std::numbers::ln2;
  RayGradient r;
  const auto of_row = [&](float PairSums::* aw, float PairSums::* a) HWY_ATTR {
    return addScaled(g.w_first, sums.get(aw, of_w), scaled(g.w_second, sums.get(a, of_a)));  // W = first w + second y
  };
  r.v_w[0] = of_row(&PairSums::aw_x, &PairSums::a_xy);
  r.v_w[1] = of_row(&PairSums::aw_y, &PairSums::a_yy);
  r.v_w[2] = of_row(&PairSums::aw, &PairSums::a_y);
  const V3 dx = g.power_d[0], dy = g.power_d[1], d0 = g.power_d[2];
  const VD b = sums.get(&PairSums::b, of_b), b_x = sums.get(&PairSums::b_x, of_b), b_y = sums.get(&PairSums::b_y, of_b);
  const VD b_xx = sums.get(&PairSums::b_xx, of_b), b_xy = sums.get(&PairSums::b_xy, of_b);
  const VD b_yy = sums.get(&PairSums::b_yy, of_b);
  r.v_d[0] = addScaled(dx, b_xx, addScaled(dy, b_xy, scaled(d0, b_x)));
  r.v_d[1] = addScaled(dx, b_xy, addScaled(dy, b_yy, scaled(d0, b_y)));
  r.v_d[2] = addScaled(dx, b_x, addScaled(dy, b_y, scaled(d0, b)));
  if (view.textured()) addTexture(g, sums, r);
  // The components that the plane model dropped.
  if (view.intersection == IntersectionModel::plane) {
    for (int j = 0; j < 3; ++j) {
      r.v_w[j].z = hn::Zero(dd);
      r.v_d[j].x = r.v_d[j].y = hn::Zero(dd);
    }
  }
  for (int j = 0; j < 3; ++j) {
    r.v_w[j] = scaled(r.v_w[j], g.unit);
    r.v_d[j] = scaled(r.v_d[j], g.unit);
  }
  return r;
}

// dL/d(raw quaternion) from dL/d(columns of the rotation matrix) (docs/math.md 6.7).
struct Quaternion {
  VD at[4];
};
HWY_INLINE Quaternion quaternionGradient(const VD* raw, const V3* g) {
  VD squared = hn::Zero(dd);
  for (int k = 0; k < 4; ++k) squared = hn::MulAdd(raw[k], raw[k], squared);
  const VD inverse = hn::Div(splat(1.0), hn::Sqrt(squared));
  VD q[4];
  for (int k = 0; k < 4; ++k) q[k] = hn::Mul(raw[k], inverse);
  const VD w = q[0];
  const V3 v = {q[1], q[2], q[3]};
  const V3 odd = {hn::Sub(g[1].z, g[2].y), hn::Sub(g[2].x, g[0].z), hn::Sub(g[0].y, g[1].x)};
  const V3 even = {hn::Add(g[1].z, g[2].y), hn::Add(g[2].x, g[0].z), hn::Add(g[0].y, g[1].x)};
  const VD two = splat(2.0);
  // From the symmetric part: row k of it times v, and the diagonal.
  const V3 symmetric = {
      hn::MulAdd(v.y, even.z, hn::NegMulAdd(hn::Mul(two, v.x), hn::Add(g[1].y, g[2].z), hn::Mul(v.z, even.y))),
      hn::MulAdd(v.x, even.z, hn::NegMulAdd(hn::Mul(two, v.y), hn::Add(g[0].x, g[2].z), hn::Mul(v.z, even.x))),
      hn::MulAdd(v.x, even.y, hn::NegMulAdd(hn::Mul(two, v.z), hn::Add(g[0].x, g[1].y), hn::Mul(v.y, even.x)))};
  const V3 v_v = scaled(addScaled(odd, w, symmetric), two);
  VD v_q[4] = {hn::Mul(two, dot(v, odd)), v_v.x, v_v.y, v_v.z};
  VD along = hn::Zero(dd);
  for (int k = 0; k < 4; ++k) along = hn::MulAdd(q[k], v_q[k], along);
  Quaternion result;
  for (int k = 0; k < 4; ++k) result.at[k] = hn::Mul(hn::NegMulAdd(q[k], along, v_q[k]), inverse);
  return result;
}

HWY_INLINE V3 transformTransposed(const glm::dmat3& m, V3 a) { return transform(glm::transpose(m), a); }

// From values of the axes a, b, c to the stored axes.
HWY_INLINE V3 storedOrder(const Geometry& g, VD a, VD b, VD c) {
  return {hn::IfThenElse(g.shortest_0, c, a), hn::IfThenElse(g.shortest_1, c, hn::IfThenElse(g.shortest_0, a, b)),
          hn::IfThenElse(g.shortest_2, c, b)};
}

// Gradient of the base colours: writes the SH coefficients' and returns the mean's, through the viewing direction.
HWY_INLINE V3 finishColor(const View& view, const GaussianModel& model, V3 mean, std::span<const SplatSums> splats,
                          ModelGradient& gradient) {
  const int count = static_cast<int>(model.shCount());
  const Directions direction = directionsTo(view, mean);
  ShBasis basis, weights;
  shBasis(direction, count, basis);
  for (int k = 0; k < count; ++k) hn::Store(hn::Zero(dbf), dbf, weights.at[k]);
  for (std::size_t lane = 0; lane < splats.size(); ++lane) {
    const Splat& s = *splats[lane].splat;
    glm::vec3 v_base;
    for (int ch = 0; ch < 3; ++ch) v_base[ch] = s.base[ch] > 0.0f ? splats[lane].pairs.base[ch] : 0.0f;  // else cut
    const glm::vec3* sh = model.sh.data() + static_cast<std::size_t>(s.gaussian) * count;
    glm::vec3* v_sh = gradient.sh.data() + static_cast<std::size_t>(s.gaussian) * count;
    for (int k = 0; k < count; ++k) {
      v_sh[k] = basis.at[k][lane] * v_base;
      weights.at[k][lane] = sh[k].x * v_base.x + sh[k].y * v_base.y + sh[k].z * v_base.z;
    }
  }
  const VB3 v = shGradient(direction, count, weights);
  const V3 v_direction = {hn::PromoteTo(dd, v.x), hn::PromoteTo(dd, v.y), hn::PromoteTo(dd, v.z)};
  const V3 across = subtract(v_direction, scaled(direction.unit, dot(direction.unit, v_direction)));
  return scaled(across, hn::Div(splat(1.0), direction.distance));
}

void finishBatch(const View& view, const GaussianModel& model, std::span<const SplatSums> splats,
                 ModelGradient& gradient) {
  std::uint32_t gaussians[kBatch];
  for (std::size_t lane = 0; lane < kBatch; ++lane) {
    gaussians[lane] = splats[std::min(lane, splats.size() - 1)].splat->gaussian;
  }
  const SumsReader sums{splats};
  const Batch batch = loadBatch(model, gaussians);
  const Geometry g = makeGeometry(view, batch);
  const RayGradient ray = rayGradient(view, g, sums);

  // W = o x D with o = -z d0: dL/do = sum D x v_w, and D gets v_w x o.
  const VD z = g.mean_c.z;
  const V3 o = scaled(g.d0, hn::Neg(z));
  const V3 v_o = add(cross(g.dx, ray.v_w[0]), add(cross(g.dy, ray.v_w[1]), cross(g.d0, ray.v_w[2])));
  V3 v_d[3];
  for (int j = 0; j < 3; ++j) v_d[j] = add(ray.v_d[j], cross(ray.v_w[j], o));

  // D = M d_c with the pixel's ray d_c = (x / fx + mean.x / z, y / fy + mean.y / z, 1), and o = -M mean.
  const VD inverse_z = hn::Div(splat(1.0), z);
  const glm::dvec2 focal = view.focal;
  V3 v_m[3];
  v_m[0] = addScaled(v_d[0], splat(1.0 / focal.x),
                     subtract(scaled(v_d[2], hn::Mul(g.mean_c.x, inverse_z)), scaled(v_o, g.mean_c.x)));
  v_m[1] = addScaled(v_d[1], splat(1.0 / focal.y),
                     subtract(scaled(v_d[2], hn::Mul(g.mean_c.y, inverse_z)), scaled(v_o, g.mean_c.y)));
  v_m[2] = subtract(v_d[2], scaled(v_o, z));

  // M = diag(1 / scale) axes_c^T.
  const V3 v_rows[3] = {{v_m[0].x, v_m[1].x, v_m[2].x}, {v_m[0].y, v_m[1].y, v_m[2].y}, {v_m[0].z, v_m[1].z, v_m[2].z}};
  const V3 rows[3] = {{g.m[0].x, g.m[1].x, g.m[2].x}, {g.m[0].y, g.m[1].y, g.m[2].y}, {g.m[0].z, g.m[1].z, g.m[2].z}};
  const VD scale[3] = {g.scale.x, g.scale.y, g.scale.z};
  VD v_scale[3];
  V3 v_axes[3];
  for (int k = 0; k < 3; ++k) {
    v_scale[k] = hn::Neg(dot(v_rows[k], rows[k]));
    v_axes[k] = transformTransposed(view.rotation, scaled(v_rows[k], hn::Div(splat(1.0), scale[k])));
  }
  const V3 v_log_scale = storedOrder(g, v_scale[0], v_scale[1], v_scale[2]);
  const V3 x = storedOrder(g, v_axes[0].x, v_axes[1].x, v_axes[2].x);
  const V3 y = storedOrder(g, v_axes[0].y, v_axes[1].y, v_axes[2].y);
  const V3 w = storedOrder(g, v_axes[0].z, v_axes[1].z, v_axes[2].z);
  const V3 v_columns[3] = {{x.x, y.x, w.x}, {x.y, y.y, w.y}, {x.z, y.z, w.z}};
  const Quaternion v_rotation = quaternionGradient(batch.rotation, v_columns);

  const VD zero = hn::Zero(dd);
  const V3 v_mean_c = {hn::Sub(zero, dot(g.m[0], v_o)), hn::Sub(zero, dot(g.m[1], v_o)),
                       hn::Sub(zero, dot(g.m[2], v_o))};
  const V3 v_mean =
      add(transformTransposed(view.rotation, v_mean_c), finishColor(view, model, batch.mean, splats, gradient));
  const VD e_x = hn::Mul(hn::Mul(v_mean_c.x, z), splat(0.5 * view.size.x / focal.x));
  const VD e_y = hn::Mul(hn::Mul(v_mean_c.y, z), splat(0.5 * view.size.y / focal.y));
  const VD screen = hn::Sqrt(hn::MulAdd(e_x, e_x, hn::Mul(e_y, e_y)));

  alignas(64) float out[11][kBatch];
  const VD values[11] = {v_mean.x,      v_mean.y,         v_mean.z,         v_log_scale.x,    v_log_scale.y,
                         v_log_scale.z, v_rotation.at[0], v_rotation.at[1], v_rotation.at[2], v_rotation.at[3],
                         screen};
  for (int k = 0; k < 11; ++k) hn::Store(hn::DemoteTo(dbf, values[k]), dbf, out[k]);
  for (std::size_t lane = 0; lane < splats.size(); ++lane) {
    const std::uint32_t i = gaussians[lane];
    const SplatSums& total = splats[lane];
    gradient.mean[i] = {out[0][lane], out[1][lane], out[2][lane]};
    gradient.log_scale[i] = {out[3][lane], out[4][lane], out[5][lane]};
    gradient.rotation[i] = {out[6][lane], out[7][lane], out[8][lane], out[9][lane]};
    gradient.opacity_logit[i] = total.pairs.opacity * (1.0f - total.splat->opacity);
    gradient.screen_gradient[i] = out[10][lane];
    gradient.screen_gradient_abs[i] = static_cast<float>(std::numbers::ln2) * total.screen_abs;
  }
}

int finishLanes() { return kBatch; }

}  // namespace
}  // namespace tg::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tg::cpu {
namespace {

HWY_EXPORT(finishBatch);
HWY_EXPORT(finishLanes);

}  // namespace

int finishBatchSize() { return HWY_DYNAMIC_DISPATCH(finishLanes)(); }

void finishSplats(const View& view, const GaussianModel& model, std::span<const SplatSums> splats,
                  ModelGradient& gradient) {
  TG_ASSERT(splats.size() <= static_cast<std::size_t>(finishBatchSize()), "no more splats than a batch");
  TG_ASSERT(gradient.mean.size() == model.size(), "the gradient has the model's size");
  HWY_DYNAMIC_DISPATCH(finishBatch)(view, model, splats, gradient);
}

}  // namespace tg::cpu
#endif
