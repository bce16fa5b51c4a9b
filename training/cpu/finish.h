// SPDX-License-Identifier: Apache-2.0
// From the sums of all its pixels to the gradient of a Gaussian's stored parameters.
#pragma once
#include "render/cpu/project.h"
#include "training/cpu/backward.h"
#include "training/gradient.h"

namespace tg::cpu {

// The sums of PairSums and PairTextureSums over all pairs of a splat, in the units of Geometry: a = dL/d|W|^2, b =
// dL/d|D|^2.
struct SplatSums {
  double aw = 0, aw_x = 0, aw_y = 0, a_y = 0, a_xy = 0, a_yy = 0;
  double b = 0, b_x = 0, b_y = 0, b_xx = 0, b_xy = 0, b_yy = 0;
  glm::dvec3 base{0.0};
  double opacity = 0;  // opacity dL/d(opacity)
  double screen_abs = 0;
  double u = 0, u_x = 0, u_y = 0, u_xx = 0, u_xy = 0, u_yy = 0;
  double v = 0, v_x = 0, v_y = 0, v_xx = 0, v_xy = 0, v_yy = 0;

  SplatSums(const PairSums& pairs, float abs);
  void set(const PairTextureSums& pairs);
};

// Writes every entry of gradient that belongs to Gaussian i, except texels and the screen radius.
void finishGaussian(const View& view, const GaussianModel& model, std::uint32_t i, const SplatSums& sums,
                    ModelGradient& gradient);

}  // namespace tg::cpu
