// SPDX-License-Identifier: Apache-2.0
// A Gaussian as a camera sees it, in double precision, one a thread: the twin of render/cpu/geometry-inl.h, where the
// names are explained.
#pragma once
#include "shared/splat.h"
#include "training/cuda/device.h"
#include "training/cuda/types.h"

namespace tg::cuda {

constexpr double kExponentScale = 0.84932180028801904272;  // sqrt(log2(e) / 2)

struct Geometry {
  int shortest;  // stored axis that is c
  glm::dvec3 mean_c;
  glm::dvec3 scale;      // of a, b, c
  glm::dvec3 axes_c[3];  // of a, b, c
  glm::dvec3 m[3];
  glm::dvec3 dx, dy, d0;
  double unit;
  glm::dvec3 power_d[3], power_w[2], kappa;
  double w_xx, w_xy, w_yy;
  double d_xx, d_xy, d_x1, d_yy, d_y1, d_11;
  glm::dvec3 w_first, w_second;
};

TG_DEVICE glm::dvec3 unitOrZero(glm::dvec3 v) {
  const double length = glm::length(v);
  return length > 0 ? v / length : glm::dvec3(0.0);
}

// of[k], for arrays that stay in registers: an index that is not known beforehand would put them into memory.
TG_DEVICE glm::dvec3 pick(const glm::dvec3* of, int k) { return k == 0 ? of[0] : k == 1 ? of[1] : of[2]; }

// Columns: the local axes in world space.
TG_DEVICE void rotationColumns(glm::dvec4 raw, glm::dvec3* columns) {
  const glm::dvec4 q = raw / sqrt(glm::dot(raw, raw));
  const double w = q.x, x = q.y, y = q.z, z = q.w;
  columns[0] = {1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)};
  columns[1] = {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)};
  columns[2] = {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
}

// Row i of an [N, 3] array.
TG_DEVICE glm::vec3 readVector(const float* from, std::size_t i) {
  return {from[3 * i], from[3 * i + 1], from[3 * i + 2]};
}
TG_DEVICE void writeVector(float* to, std::size_t i, glm::vec3 v) {
  for (int k = 0; k < 3; ++k) to[3 * i + k] = v[k];
}

// Zeros for Gaussian i.
TG_DEVICE void clearRows(const FieldRows& rows, std::size_t i) {
  for (const FieldRows::Row& field : rows.of) {
    for (unsigned k = 0; k < field.row; ++k) field.floats[i * field.row + k] = 0.0f;
  }
}

TG_DEVICE glm::dvec3 readMean(const Parameters& model, std::size_t i) {
  return {model.mean[3 * i], model.mean[3 * i + 1], model.mean[3 * i + 2]};
}
TG_DEVICE glm::dvec4 readRotation(const Parameters& model, std::size_t i) {
  return {model.rotation[4 * i], model.rotation[4 * i + 1], model.rotation[4 * i + 2], model.rotation[4 * i + 3]};
}
TG_DEVICE glm::vec3 readLogScale(const Parameters& model, std::size_t i) { return readVector(model.log_scale, i); }

TG_DEVICE Geometry makeGeometry(const View& view, const Parameters& model, std::size_t i) {
  Geometry g;
  const bool plane = view.intersection == kIntersectPlane;
  const glm::vec3 log_scale = readLogScale(model, i);
  g.shortest = shortestAxis(log_scale);
  const int order[3] = {axisU(g.shortest), axisV(g.shortest), g.shortest};
  glm::dvec3 columns[3];
  rotationColumns(readRotation(model, i), columns);
  g.mean_c = cameraFromWorld(view, readMean(model, i));
  for (int k = 0; k < 3; ++k) {
    g.axes_c[k] = view.rotation * pick(columns, order[k]);
    g.scale[k] = ::exp(static_cast<double>(log_scale[order[k]]));
  }
  const double longest = glm::min(glm::max(g.scale.x, glm::max(g.scale.y, g.scale.z)), double{kScaleMax});
  g.scale = glm::clamp(g.scale, kThinnest * longest, longest);
  for (int j = 0; j < 3; ++j) {
    g.m[j] = glm::dvec3(g.axes_c[0][j], g.axes_c[1][j], g.axes_c[2][j]) / g.scale;
  }
  const double z = g.mean_c.z;
  g.dx = g.m[0] / view.focal.x;
  g.dy = g.m[1] / view.focal.y;
  g.d0 = g.m[0] * (g.mean_c.x / z) + g.m[1] * (g.mean_c.y / z) + g.m[2];

  g.unit = 1 / glm::length(g.d0);
  g.power_d[0] = g.dx * g.unit;
  g.power_d[1] = g.dy * g.unit;
  g.power_d[2] = g.d0 * g.unit;
  g.power_w[0] = glm::cross(g.dx, g.d0) * (g.unit * z);  // o = -z d0
  g.power_w[1] = glm::cross(g.dy, g.d0) * (g.unit * z);
  g.kappa = glm::cross(g.dx, g.dy) * (g.unit * z);
  if (plane) {
    for (glm::dvec3& d : g.power_d) d.x = d.y = 0;
    for (glm::dvec3& w : g.power_w) w.z = 0;
    g.kappa.z = 0;
  }
  g.w_first = unitOrZero(g.power_w[0]);
  g.w_xx = glm::length(g.power_w[0]);
  g.w_xy = glm::dot(g.w_first, g.power_w[1]);
  g.w_second = g.power_w[1] - g.w_first * g.w_xy;
  g.w_yy = glm::length(g.w_second);
  const glm::dvec3 first = plane ? glm::dvec3(0, 0, 1) : unitOrZero(g.power_d[0]);
  g.d_xx = glm::dot(first, g.power_d[0]);
  g.d_xy = glm::dot(first, g.power_d[1]);
  g.d_x1 = glm::dot(first, g.power_d[2]);
  g.d_yy = g.d_y1 = g.d_11 = 0;
  if (!plane) {
    const glm::dvec3 rest_y = g.power_d[1] - first * g.d_xy;
    const glm::dvec3 rest_1 = g.power_d[2] - first * g.d_x1;
    const glm::dvec3 second = unitOrZero(rest_y);
    g.d_yy = glm::length(rest_y);
    g.d_y1 = glm::dot(second, rest_1);
    g.d_11 = glm::length(rest_1 - second * g.d_y1);
  }
  return g;
}

}  // namespace tg::cuda
