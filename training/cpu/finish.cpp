// SPDX-License-Identifier: Apache-2.0
// The chain rule of one Gaussian, in double precision: it runs once per visible Gaussian, not per pixel.
#include "training/cpu/finish.h"

#include <cmath>
#include <numbers>

#include "shared/sh.h"

namespace tg::cpu {
namespace {

// dL/d(raw quaternion) from g[column][row] = dL/d(rotation matrix) (docs/math.md 6.7).
glm::dvec4 quaternionGradient(glm::dvec4 raw, const glm::dmat3& g) {
  const double length = glm::length(raw);
  const glm::dvec4 q = raw / length;
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const glm::dvec3 odd(g[1][2] - g[2][1], g[2][0] - g[0][2], g[0][1] - g[1][0]);   // from the antisymmetric part
  const glm::dvec3 even(g[1][2] + g[2][1], g[2][0] + g[0][2], g[0][1] + g[1][0]);  // and from the symmetric one
  const glm::dvec4 v_q = 2.0 * glm::dvec4(x * odd.x + y * odd.y + z * odd.z,
                                          w * odd.x + y * even.z + z * even.y - 2.0 * x * (g[1][1] + g[2][2]),
                                          w * odd.y + x * even.z + z * even.x - 2.0 * y * (g[0][0] + g[2][2]),
                                          w * odd.z + x * even.y + y * even.x - 2.0 * z * (g[0][0] + g[1][1]));
  return (v_q - q * glm::dot(q, v_q)) / length;
}

// dL/d(W) and dL/d(D) summed against (x, y, 1): column j belongs to factor j.
struct RayGradient {
  glm::dmat3 v_w{0.0};
  glm::dmat3 v_d{0.0};
};

RayGradient rayGradient(const Geometry& g, bool plane, const SplatSums& s) {
  RayGradient r;
  // |W|^2: 2 a W, W = w_first w + w_second y.
  r.v_w[0] = 2.0 * (g.w_first * s.aw_x + g.w_second * s.a_xy);
  r.v_w[1] = 2.0 * (g.w_first * s.aw_y + g.w_second * s.a_yy);
  r.v_w[2] = 2.0 * (g.w_first * s.aw + g.w_second * s.a_y);
  // |D|^2: 2 b D.
  const glm::dvec3 dx = g.power_d[0], dy = g.power_d[1], d0 = g.power_d[2];
  r.v_d[0] = 2.0 * (dx * s.b_xx + dy * s.b_xy + d0 * s.b_x);
  r.v_d[1] = 2.0 * (dx * s.b_xy + dy * s.b_yy + d0 * s.b_y);
  r.v_d[2] = 2.0 * (dx * s.b_x + dy * s.b_y + d0 * s.b);
  // The numerators of u and v are the first two components of D x W: with q = (u, v, 0) numerators' gradients,
  // dL/dD = W x q and dL/dW = q x D.
  const glm::dvec3 q(s.u, s.v, 0.0), q_x(s.u_x, s.v_x, 0.0), q_y(s.u_y, s.v_y, 0.0);
  const glm::dvec3 q_xx(s.u_xx, s.v_xx, 0.0), q_xy(s.u_xy, s.v_xy, 0.0), q_yy(s.u_yy, s.v_yy, 0.0);
  const glm::dvec3 wx = g.power_w[0], wy = g.power_w[1];
  r.v_d[0] += glm::cross(wx, q_xx) + glm::cross(wy, q_xy);
  r.v_d[1] += glm::cross(wx, q_xy) + glm::cross(wy, q_yy);
  r.v_d[2] += glm::cross(wx, q_x) + glm::cross(wy, q_y);
  r.v_w[0] += glm::cross(q_xx, dx) + glm::cross(q_xy, dy) + glm::cross(q_x, d0);
  r.v_w[1] += glm::cross(q_xy, dx) + glm::cross(q_yy, dy) + glm::cross(q_y, d0);
  r.v_w[2] += glm::cross(q_x, dx) + glm::cross(q_y, dy) + glm::cross(q, d0);
  // The components that the plane model dropped.
  if (plane) {
    for (int j = 0; j < 3; ++j) {
      r.v_w[j].z = 0.0;
      r.v_d[j].x = r.v_d[j].y = 0.0;
    }
  }
  r.v_w *= g.unit;
  r.v_d *= g.unit;
  return r;
}

// Gradient of the base colour: SH coefficients, and the mean through the viewing direction.
glm::dvec3 finishColor(const View& view, const GaussianModel& model, std::uint32_t i, glm::dvec3 v_base,
                       ModelGradient& gradient) {
  const glm::dvec3 offset = glm::dvec3(model.mean[i]) - view.position;
  const double distance = glm::length(offset);
  const glm::dvec3 direction = offset / distance;
  const glm::vec3 direction_f(direction);
  glm::vec4 basis[4];
  shBasis(direction_f, basis[0], basis[1], basis[2], basis[3]);
  const int count = model.shCount();
  const std::size_t first = static_cast<std::size_t>(i) * count;
  glm::dvec3 color(0.5);
  for (int k = 0; k < count; ++k) color += static_cast<double>(basis[k / 4][k % 4]) * glm::dvec3(model.sh[first + k]);
  for (int ch = 0; ch < 3; ++ch) {
    if (color[ch] <= 0.0) v_base[ch] = 0.0;
  }
  glm::dvec3 v_direction(0.0);
  for (int k = 0; k < count; ++k) {
    gradient.v_sh[first + k] = glm::vec3(static_cast<double>(basis[k / 4][k % 4]) * v_base);
    if (k > 0) {
      v_direction += glm::dvec3(shBasisGradient(direction_f, static_cast<uint>(k))) *
                     glm::dot(glm::dvec3(model.sh[first + k]), v_base);
    }
  }
  return (v_direction - direction * glm::dot(direction, v_direction)) / distance;
}

}  // namespace

SplatSums::SplatSums(const PairSums& pairs, float abs) {
  constexpr double kLn2 = std::numbers::ln2;
  const double of_aw = -kLn2 * kExponentScale;  // dL/d|W|^2 = -ln 2 a, in Geometry's units of W
  const double of_a = of_aw * kExponentScale;
  aw = of_aw * pairs.aw;
  aw_x = of_aw * pairs.aw_x;
  aw_y = of_aw * pairs.aw_y;
  a_y = of_a * pairs.a_y;
  a_xy = of_a * pairs.a_xy;
  a_yy = of_a * pairs.a_yy;
  b = kLn2 * pairs.b;
  b_x = kLn2 * pairs.b_x;
  b_y = kLn2 * pairs.b_y;
  b_xx = kLn2 * pairs.b_xx;
  b_xy = kLn2 * pairs.b_xy;
  b_yy = kLn2 * pairs.b_yy;
  base = {pairs.base[0], pairs.base[1], pairs.base[2]};
  opacity = pairs.opacity;
  screen_abs = kLn2 * abs;
}

void SplatSums::set(const PairTextureSums& pairs) {
  u = pairs.u;
  u_x = pairs.u_x;
  u_y = pairs.u_y;
  u_xx = pairs.u_xx;
  u_xy = pairs.u_xy;
  u_yy = pairs.u_yy;
  v = pairs.v;
  v_x = pairs.v_x;
  v_y = pairs.v_y;
  v_xx = pairs.v_xx;
  v_xy = pairs.v_xy;
  v_yy = pairs.v_yy;
}

void finishGaussian(const View& view, const GaussianModel& model, std::uint32_t i, const SplatSums& sums,
                    ModelGradient& gradient) {
  const Geometry g = makeGeometry(view, model, i);
  const RayGradient ray = rayGradient(g, view.intersection == IntersectionModel::plane, sums);

  // W = o x D: dL/do = sum D x v_w, and D gets v_w x o.
  const glm::dvec3 v_o = glm::cross(g.dx, ray.v_w[0]) + glm::cross(g.dy, ray.v_w[1]) + glm::cross(g.d0, ray.v_w[2]);
  glm::dmat3 v_d = ray.v_d;
  for (int j = 0; j < 3; ++j) v_d[j] += glm::cross(ray.v_w[j], g.o);

  // D = M d_c with the pixel's ray d_c = (x / fx + mean.x / z, y / fy + mean.y / z, 1), and o = -M mean.
  const glm::dvec3 center = g.mean_c / g.mean_c.z;
  const glm::dvec2 focal(view.focal_center.x, view.focal_center.y);
  glm::dmat3 v_m;
  v_m[0] = v_d[0] / focal.x + center.x * v_d[2] - g.mean_c.x * v_o;
  v_m[1] = v_d[1] / focal.y + center.y * v_d[2] - g.mean_c.y * v_o;
  v_m[2] = v_d[2] - g.mean_c.z * v_o;

  // M = diag(1 / scale) axes_c^T.
  glm::dmat3 v_rotation;
  glm::vec3& v_log_scale = gradient.v_log_scale[i];
  for (int k = 0; k < 3; ++k) {
    const glm::dvec3 v_row(v_m[0][k], v_m[1][k], v_m[2][k]);
    const glm::dvec3 row(g.m[0][k], g.m[1][k], g.m[2][k]);
    v_log_scale[g.axes[k]] = static_cast<float>(-glm::dot(v_row, row));
    v_rotation[g.axes[k]] = glm::transpose(view.camera_from_world_rotation) * v_row / g.scale[k];
  }
  gradient.v_rotation[i] = glm::vec4(quaternionGradient(glm::dvec4(model.rotation[i]), v_rotation));

  const glm::dvec3 v_mean_c = -glm::transpose(g.m) * v_o;
  gradient.v_mean[i] = glm::vec3(glm::transpose(view.camera_from_world_rotation) * v_mean_c +
                                 finishColor(view, model, i, sums.base, gradient));
  gradient.v_opacity_logit[i] = static_cast<float>(sums.opacity * (1.0 - opacity(model.opacity_logit[i])));
  const glm::dvec2 e(v_mean_c.x * g.mean_c.z / focal.x * view.width / 2,
                     v_mean_c.y * g.mean_c.z / focal.y * view.height / 2);
  gradient.screen_gradient[i] = static_cast<float>(glm::length(e));
  gradient.screen_gradient_abs[i] = static_cast<float>(sums.screen_abs);
}

}  // namespace tg::cpu
