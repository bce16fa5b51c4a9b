// SPDX-License-Identifier: Apache-2.0
// One thread a Gaussian, in double precision: the twin of training/cpu/finish.cpp (docs/math.md 6.5 to 6.9). What large
// splats have more is added up before, a warp a run of pairs: the device does not wait for one thread.
#include "training/cuda/finish.h"

#include "shared/sh.h"
#include "training/cuda/geometry.h"

namespace tg::cuda {
namespace {

constexpr double kLn2 = 0.69314718055994530942;

static_assert(kFieldCount == 5, "finishKernel() leaves the gradient of the new parameter as the memory was: write it");
static_assert(kSums + kTextureSums + 1 <= kWarp && kRun == 2 * kWarp);

// A warp takes the runs that begin at its kRun pairs. A lane takes one of the sums, so that a pair is read at once.
TG_KERNEL runKernel(RunInput in) {
  const std::size_t begin = itemIndex() / kWarp * kRun;
  const unsigned lane = threadIdx.x % kWarp;
  const PairCount pairs = *in.pairs;
  if (pairs > in.room) return;
  for (unsigned half = 0; half < kRun; half += kWarp) {
    const std::size_t pair = begin + half + lane;
    std::uint32_t length = 0;  // of the run that begins at the lane's pair
    if (pair < pairs) {
      const std::uint32_t i = in.gaussian[pair];
      const std::uint32_t count = in.tile_counts[i];
      const std::uint32_t place = count > kRun ? static_cast<std::uint32_t>(pair) - in.pair_begin[i] : 1;
      if (place % kRun == 0) length = count - place < kRun ? count - place : kRun;
    }
    for (unsigned left = __ballot_sync(kAllLanes, length > 0); left != 0; left &= left - 1) {
      const int leader = __ffs(left) - 1;
      const std::size_t first = begin + half + static_cast<unsigned>(leader);
      const std::uint32_t count = __shfl_sync(kAllLanes, length, leader);
      const unsigned shows[2] = {__ballot_sync(kAllLanes, lane < count && in.shows[first + lane] != 0),
                                 __ballot_sync(kAllLanes, lane + kWarp < count && in.shows[first + kWarp + lane] != 0)};
      if ((shows[0] | shows[1]) == 0) continue;
      float sum = 0.0f;
      for (int word = 0; word < 2; ++word) {
#pragma unroll 8
        for (unsigned k = 0; k < kWarp; ++k) {
          if ((shows[word] >> k & 1u) == 0 || lane >= in.stride) continue;
          sum += in.sums[(first + word * kWarp + k) * in.stride + lane];
        }
      }
      if (lane < in.stride) in.sums[first * in.stride + lane] = sum;
      if (lane == 0) in.shows[first] = 1;
    }
  }
}

struct FinishArguments {
  FinishInput in;
  Parameters gradient;
  FieldRows rows;  // of the gradient
  float* screen_gradient;
  float* screen_gradient_abs;
};

// dL/dW and dL/dD summed against (x, y, 1): element j belongs to factor j.
struct RayGradient {
  glm::dvec3 v_w[3];
  glm::dvec3 v_d[3];
};

// The order of PairSums.
TG_DEVICE RayGradient rayGradient(const View& view, const Geometry& g, const float* sums) {
  const double of_w = -2.0 * kLn2 * kExponentScale;
  const double of_a = of_w * kExponentScale;
  const double of_b = 2.0 * kLn2;
  const double aw = of_w * sums[4], aw_x = of_w * sums[5], aw_y = of_w * sums[6];
  const double a_y = of_a * sums[7], a_xy = of_a * sums[8], a_yy = of_a * sums[9];
  const double b = of_b * sums[10], b_x = of_b * sums[11], b_y = of_b * sums[12];
  const double b_xx = of_b * sums[13], b_xy = of_b * sums[14], b_yy = of_b * sums[15];
  const glm::dvec3 dx = g.power_d[0], dy = g.power_d[1], d0 = g.power_d[2];
  RayGradient r;
  r.v_w[0] = g.w_first * aw_x + g.w_second * a_xy;
  r.v_w[1] = g.w_first * aw_y + g.w_second * a_yy;
  r.v_w[2] = g.w_first * aw + g.w_second * a_y;
  r.v_d[0] = dx * b_xx + dy * b_xy + d0 * b_x;
  r.v_d[1] = dx * b_xy + dy * b_yy + d0 * b_y;
  r.v_d[2] = dx * b_x + dy * b_y + d0 * b;
  if (view.texture_rgb || view.texture_alpha) {
    // The numerators of u and v are the first two components of D x W.
    const float* t = sums + kSums;
    const auto q = [&](int k) { return glm::dvec3(t[k], t[6 + k], 0.0); };
    const glm::dvec3 q_1 = q(0), q_x = q(1), q_y = q(2), q_xx = q(3), q_xy = q(4), q_yy = q(5);
    const glm::dvec3 wx = g.power_w[0], wy = g.power_w[1];
    r.v_d[0] += glm::cross(wx, q_xx) + glm::cross(wy, q_xy);
    r.v_d[1] += glm::cross(wx, q_xy) + glm::cross(wy, q_yy);
    r.v_d[2] += glm::cross(wx, q_x) + glm::cross(wy, q_y);
    r.v_w[0] += glm::cross(q_xx, dx) + glm::cross(q_xy, dy) + glm::cross(q_x, d0);
    r.v_w[1] += glm::cross(q_xy, dx) + glm::cross(q_yy, dy) + glm::cross(q_y, d0);
    r.v_w[2] += glm::cross(q_x, dx) + glm::cross(q_y, dy) + glm::cross(q_1, d0);
  }
  const bool plane = view.intersection == kIntersectPlane;
  for (int j = 0; j < 3; ++j) {
    if (plane) r.v_w[j].z = r.v_d[j].x = r.v_d[j].y = 0;
    r.v_w[j] *= g.unit;
    r.v_d[j] *= g.unit;
  }
  return r;
}

// dL/d(raw quaternion) from dL/d(columns of the rotation matrix) (docs/math.md 6.7).
TG_DEVICE glm::dvec4 quaternionGradient(glm::dvec4 raw, const glm::dvec3* g) {
  const double inverse = 1 / sqrt(glm::dot(raw, raw));
  const glm::dvec4 q = raw * inverse;
  const glm::dvec3 v(q.y, q.z, q.w);
  const glm::dvec3 odd(g[1].z - g[2].y, g[2].x - g[0].z, g[0].y - g[1].x);
  const glm::dvec3 even(g[1].z + g[2].y, g[2].x + g[0].z, g[0].y + g[1].x);
  const glm::dvec3 symmetric(v.y * even.z + v.z * even.y - 2 * v.x * (g[1].y + g[2].z),
                             v.x * even.z + v.z * even.x - 2 * v.y * (g[0].x + g[2].z),
                             v.x * even.y + v.y * even.x - 2 * v.z * (g[0].x + g[1].y));
  const glm::dvec3 v_v = 2.0 * (odd * q.x + symmetric);
  const glm::dvec4 v_q(2 * glm::dot(v, odd), v_v.x, v_v.y, v_v.z);
  return (v_q - q * glm::dot(q, v_q)) * inverse;
}

// The SH coefficients' gradient; returns the mean's, through the viewing direction.
TG_DEVICE glm::dvec3 finishColor(const FinishArguments& a, std::size_t i, const float* sums) {
  const Parameters& model = a.in.model;
  const BlendSplat& s = a.in.splats[i];
  const glm::dvec3 offset = readMean(model, i) - a.in.view.eye;
  const double distance = glm::length(offset);
  const glm::dvec3 unit = offset / distance;
  const glm::vec3 direction(unit);
  vec4 basis[4];
  shBasis(direction, basis[0], basis[1], basis[2], basis[3]);
  float v_base[3];
  for (int c = 0; c < 3; ++c) v_base[c] = s.base[c] > 0.0f ? sums[c] : 0.0f;  // else cut
  const float* sh = model.sh + i * 3 * model.sh_count;
  float* v_sh = a.gradient.sh + i * 3 * model.sh_count;
  glm::vec3 v_direction(0.0f);
  for (int k = 0; k < model.sh_count; ++k) {
    float weight = 0.0f;
    for (int c = 0; c < 3; ++c) {
      v_sh[3 * k + c] = basis[k / 4][k % 4] * v_base[c];
      weight += sh[3 * k + c] * v_base[c];
    }
    v_direction += weight * shBasisGradient(direction, static_cast<uint>(k));
  }
  const glm::dvec3 v(v_direction);
  return (v - unit * glm::dot(unit, v)) / distance;
}

TG_DEVICE void clear(const FinishArguments& a, std::size_t i) {
  clearRows(a.rows, i);
  a.screen_gradient[i] = a.screen_gradient_abs[i] = 0.0f;
}

TG_KERNEL finishKernel(FinishArguments a) {
  const std::size_t i = itemIndex();
  if (i >= a.in.model.count || *a.in.pairs > a.in.room) return;
  const View& view = a.in.view;
  const bool textured = view.texture_rgb || view.texture_alpha;
  const unsigned stride = pairSums(textured, a.in.statistics);
  constexpr unsigned kMost = pairSums(true, true);
  float sums[kMost] = {};
  bool shows = false;
  const std::uint32_t count = a.in.tile_counts[i];
  const std::size_t first = count > 0 ? a.in.pair_begin[i] : 0;
  for (std::size_t pair = first; pair<first + count; pair += count> kRun ? kRun : 1) {
    if (a.in.shows[pair] == 0) continue;
    shows = true;
#pragma unroll
    for (unsigned k = 0; k < kMost; ++k) {
      if (k < stride) sums[k] += a.in.sums[pair * stride + k];
    }
  }
  if (!shows) {
    clear(a, i);
    return;
  }
  const Geometry g = makeGeometry(view, a.in.model, i);
  const RayGradient ray = rayGradient(view, g, sums);

  // W = o x D with o = -z d0: dL/do = sum D x v_w, and D gets v_w x o.
  const double z = g.mean_c.z;
  const glm::dvec3 o = g.d0 * -z;
  const glm::dvec3 v_o = glm::cross(g.dx, ray.v_w[0]) + glm::cross(g.dy, ray.v_w[1]) + glm::cross(g.d0, ray.v_w[2]);
  glm::dvec3 v_d[3];
  for (int j = 0; j < 3; ++j) v_d[j] = ray.v_d[j] + glm::cross(ray.v_w[j], o);

  // D = M d_c with the pixel's ray d_c = (x / fx + mean.x / z, y / fy + mean.y / z, 1), and o = -M mean.
  const glm::dvec2 f = view.focal;
  const glm::dvec3 v_m[3] = {v_d[0] / f.x + v_d[2] * (g.mean_c.x / z) - v_o * g.mean_c.x,
                             v_d[1] / f.y + v_d[2] * (g.mean_c.y / z) - v_o * g.mean_c.y, v_d[2] - v_o * z};

  // M = diag(1 / scale) axes_c^T.
  const int order[3] = {axisU(g.shortest), axisV(g.shortest), g.shortest};
  const glm::dmat3 world_from_camera = glm::transpose(view.rotation);
  glm::dvec3 v_axes[3];  // of a, b, c
  for (int k = 0; k < 3; ++k) {
    const glm::dvec3 v_row(v_m[0][k], v_m[1][k], v_m[2][k]);
    const glm::dvec3 row(g.m[0][k], g.m[1][k], g.m[2][k]);
    a.gradient.log_scale[3 * i + order[k]] = static_cast<float>(-glm::dot(v_row, row));
    v_axes[k] = world_from_camera * (v_row / g.scale[k]);
  }
  glm::dvec3 v_columns[3];
  for (int k = 0; k < 3; ++k) v_columns[k] = pick(v_axes, k == order[0] ? 0 : k == order[1] ? 1 : 2);
  const glm::dvec4 v_rotation = quaternionGradient(readRotation(a.in.model, i), v_columns);
  for (int k = 0; k < 4; ++k) a.gradient.rotation[4 * i + k] = static_cast<float>(v_rotation[k]);

  const glm::dvec3 v_mean_c = -glm::dvec3(glm::dot(g.m[0], v_o), glm::dot(g.m[1], v_o), glm::dot(g.m[2], v_o));
  const glm::dvec3 v_mean = world_from_camera * v_mean_c + finishColor(a, i, sums);
  for (int k = 0; k < 3; ++k) a.gradient.mean[3 * i + k] = static_cast<float>(v_mean[k]);
  const double opacity = ::exp2(static_cast<double>(a.in.splats[i].log2_opacity));
  a.gradient.opacity_logit[i] = static_cast<float>(sums[3] * (1.0 - opacity));

  const double e_x = v_mean_c.x * z * (0.5 * view.size.x / f.x);
  const double e_y = v_mean_c.y * z * (0.5 * view.size.y / f.y);
  a.screen_gradient[i] = static_cast<float>(sqrt(e_x * e_x + e_y * e_y));
  a.screen_gradient_abs[i] =
      a.in.statistics ? static_cast<float>(kLn2) * (textured ? sums[kMost - 1] : sums[kSums]) : 0.0f;
}

}  // namespace

void addRuns(const RunInput& input) {
  const std::size_t warps = (input.room + kRun - 1) / kRun;
  launch("runs", runKernel, blocksFor(warps * kWarp), input);
}

void finishGradients(const FinishInput& input, const Parameters& gradient, float* screen_gradient,
                     float* screen_gradient_abs) {
  launch("finish", finishKernel, blocksFor(input.model.count),
         FinishArguments{input, gradient, rowsOf(gradient, gradient.sh_count, [](float* values) { return values; }),
                         screen_gradient, screen_gradient_abs});
}

}  // namespace tg::cuda
