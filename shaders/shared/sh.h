// SPDX-License-Identifier: Apache-2.0
// Real spherical harmonics to degree 3 with INRIA's signs (Condon-Shortley phase in the constants), and derivatives.
#ifndef TG_SH_H
#define TG_SH_H
#include "shared/lang.h"
TG_NAMESPACE_BEGIN

TG_FN uint shCoefficientCount(uint degree) { return (degree + 1u) * (degree + 1u); }

// Basis functions 0..15 at the unit direction `dir` (from the camera to the mean, world space).
TG_FN void shBasis(vec3 dir, TG_OUT(vec4) b0, TG_OUT(vec4) b1, TG_OUT(vec4) b2, TG_OUT(vec4) b3) {
  float x = dir.x;
  float y = dir.y;
  float z = dir.z;
  float xx = x * x;
  float yy = y * y;
  float zz = z * z;
  b0 = vec4(0.28209479177387814f, -0.4886025119029199f * y, 0.4886025119029199f * z, -0.4886025119029199f * x);
  b1 = vec4(1.0925484305920792f * x * y, -1.0925484305920792f * y * z, 0.31539156525252005f * (2.0f * zz - xx - yy),
            -1.0925484305920792f * x * z);
  b2 = vec4(0.5462742152960396f * (xx - yy), -0.5900435899266435f * y * (3.0f * xx - yy),
            2.890611442640554f * x * y * z, -0.4570457994644658f * y * (4.0f * zz - xx - yy));
  b3 = vec4(0.3731763325901154f * z * (2.0f * zz - 3.0f * xx - 3.0f * yy),
            -0.4570457994644658f * x * (4.0f * zz - xx - yy), 1.445305721320277f * z * (xx - yy),
            -0.5900435899266435f * x * (xx - 3.0f * yy));
}

// Gradient of basis function k with respect to dir, dir treated as three free variables.
TG_FN vec3 shBasisGradient(vec3 dir, uint k) {
  float x = dir.x;
  float y = dir.y;
  float z = dir.z;
  float xx = x * x;
  float yy = y * y;
  float zz = z * z;
  const float c1 = 0.4886025119029199f;
  const float c2 = 1.0925484305920792f;
  const float c20 = 0.31539156525252005f;
  const float c22 = 0.5462742152960396f;
  const float c33 = 0.5900435899266435f;
  const float c32 = 2.890611442640554f;
  const float c31 = 0.4570457994644658f;
  const float c30 = 0.3731763325901154f;
  const float c34 = 1.445305721320277f;
  if (k == 1u) return vec3(0.0f, -c1, 0.0f);
  if (k == 2u) return vec3(0.0f, 0.0f, c1);
  if (k == 3u) return vec3(-c1, 0.0f, 0.0f);
  if (k == 4u) return vec3(c2 * y, c2 * x, 0.0f);
  if (k == 5u) return vec3(0.0f, -c2 * z, -c2 * y);
  if (k == 6u) return vec3(-2.0f * c20 * x, -2.0f * c20 * y, 4.0f * c20 * z);
  if (k == 7u) return vec3(-c2 * z, 0.0f, -c2 * x);
  if (k == 8u) return vec3(2.0f * c22 * x, -2.0f * c22 * y, 0.0f);
  if (k == 9u) return vec3(-6.0f * c33 * x * y, -3.0f * c33 * (xx - yy), 0.0f);
  if (k == 10u) return vec3(c32 * y * z, c32 * x * z, c32 * x * y);
  if (k == 11u) return vec3(2.0f * c31 * x * y, -c31 * (4.0f * zz - xx - 3.0f * yy), -8.0f * c31 * y * z);
  if (k == 12u) return vec3(-6.0f * c30 * x * z, -6.0f * c30 * y * z, c30 * (6.0f * zz - 3.0f * xx - 3.0f * yy));
  if (k == 13u) return vec3(-c31 * (4.0f * zz - 3.0f * xx - yy), 2.0f * c31 * x * y, -8.0f * c31 * x * z);
  if (k == 14u) return vec3(2.0f * c34 * x * z, -2.0f * c34 * y * z, c34 * (xx - yy));
  if (k == 15u) return vec3(-3.0f * c33 * (xx - yy), 6.0f * c33 * x * y, 0.0f);
  return vec3(0.0f, 0.0f, 0.0f);
}

TG_NAMESPACE_END
#endif
