// SPDX-License-Identifier: Apache-2.0
// Axis conventions and rotations of spherical harmonics.
#include "converter/gltf/axes.h"

#include <array>
#include <cmath>
#include <utility>

#include "core/system/assert.h"
#include "shared/sh.h"
#include "shared/splat.h"

namespace tg {
namespace {

constexpr int kMaxDegree = 3;
constexpr int kDirections = 64;  // on a Fibonacci sphere: every band's normal matrix is close to a multiple of identity

// Basis functions 0..15 at a direction.
std::array<double, 16> basisAt(glm::dvec3 direction) {
  glm::vec4 b[4];
  shBasis(glm::vec3(direction), b[0], b[1], b[2], b[3]);
  std::array<double, 16> values{};
  for (int k = 0; k < 16; ++k) values[k] = b[k / 4][k % 4];
  return values;
}

// Solves A X = B in place of B by Gauss-Jordan with row pivots; A is n x n, B is n x n, row-major.
void solve(std::vector<double> a, std::vector<double>& b, int n) {
  for (int column = 0; column < n; ++column) {
    int pivot = column;
    for (int row = column + 1; row < n; ++row) {
      if (std::abs(a[row * n + column]) > std::abs(a[pivot * n + column])) pivot = row;
    }
    for (int k = 0; k < n; ++k) {
      std::swap(a[column * n + k], a[pivot * n + k]);
      std::swap(b[column * n + k], b[pivot * n + k]);
    }
    const double scale = 1.0 / a[column * n + column];
    for (int k = 0; k < n; ++k) {
      a[column * n + k] *= scale;
      b[column * n + k] *= scale;
    }
    for (int row = 0; row < n; ++row) {
      if (row == column) continue;
      const double factor = a[row * n + column];
      for (int k = 0; k < n; ++k) {
        a[row * n + k] -= factor * a[column * n + k];
        b[row * n + k] -= factor * b[column * n + k];
      }
    }
  }
}

// Column k of the result is column order[k] of q's matrix; column `normal` of the result is turned if need be.
glm::vec4 permuted(glm::vec4 q, glm::ivec3 order, int normal) {
  const glm::dmat3 from = matrixFromQuaternion(glm::dvec4(q));
  glm::dmat3 to(from[order.x], from[order.y], from[order.z]);
  if (glm::determinant(to) < 0.0) to[normal] = -to[normal];
  return glm::vec4(quaternionFromMatrix(to));
}

}  // namespace

void turnShAxes(std::span<glm::vec3> sh) {
  TG_ASSERT(sh.size() == 1 || sh.size() == 4 || sh.size() == 9 || sh.size() == 16, "the coefficients of whole degrees");
  // Signs of the basis functions under (x, y, z) -> (-x, -y, z): degree 1 | 2 | 3.
  constexpr std::array<float, 16> signs = {1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1};
  for (std::size_t k = 0; k < sh.size(); ++k) sh[k] *= signs[k];
}

glm::dmat3 matrixFromQuaternion(glm::dvec4 q) {
  TG_ASSERT(glm::dot(q, q) > 0.0, "a quaternion has a length");
  q /= glm::length(q);
  const double w = q.x, x = q.y, y = q.z, z = q.w;
  return glm::dmat3(glm::dvec3(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
                    glm::dvec3(2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
                    glm::dvec3(2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)));
}

glm::dvec4 quaternionFromMatrix(const glm::dmat3& m) {
  // Four times the square of each component; the largest is divided by, so that nothing cancels.
  const glm::dvec4 squares(1 + m[0][0] + m[1][1] + m[2][2], 1 + m[0][0] - m[1][1] - m[2][2],
                           1 - m[0][0] + m[1][1] - m[2][2], 1 - m[0][0] - m[1][1] + m[2][2]);
  int largest = 0;
  for (int k = 1; k < 4; ++k) {
    if (squares[k] > squares[largest]) largest = k;
  }
  const double wx = m[1][2] - m[2][1], wy = m[2][0] - m[0][2], wz = m[0][1] - m[1][0];
  const double xy = m[0][1] + m[1][0], xz = m[0][2] + m[2][0], yz = m[1][2] + m[2][1];
  const std::array<glm::dvec4, 4> rows = {glm::dvec4(squares[0], wx, wy, wz), glm::dvec4(wx, squares[1], xy, xz),
                                          glm::dvec4(wy, xy, squares[2], yz), glm::dvec4(wz, xz, yz, squares[3])};
  return glm::normalize(rows[largest]);
}

glm::dvec4 multiply(glm::dvec4 a, glm::dvec4 b) {
  return {a.x * b.x - a.y * b.y - a.z * b.z - a.w * b.w, a.x * b.y + a.y * b.x + a.z * b.w - a.w * b.z,
          a.x * b.z - a.y * b.w + a.z * b.x + a.w * b.y, a.x * b.w + a.y * b.z - a.z * b.y + a.w * b.x};
}

ShRotation::ShRotation(const glm::dmat3& rotation) {
  // A band is closed under rotation: c' . Y(d) = c . Y(R^T d) for all d. Least squares over many directions gives
  // the matrix from c to c'.
  std::vector<std::array<double, 16>> at, turned;
  const double golden_angle = M_PI * (3.0 - std::sqrt(5.0));
  for (int i = 0; i < kDirections; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / kDirections;
    const double r = std::sqrt(1.0 - z * z);
    const glm::dvec3 direction(r * std::cos(golden_angle * i), r * std::sin(golden_angle * i), z);
    at.push_back(basisAt(direction));
    turned.push_back(basisAt(glm::transpose(rotation) * direction));
  }
  for (int l = 1; l <= kMaxDegree; ++l) {
    const int n = 2 * l + 1;
    std::vector<double> normal(n * n, 0.0), right(n * n, 0.0);
    for (int i = 0; i < kDirections; ++i) {
      for (int row = 0; row < n; ++row) {
        for (int column = 0; column < n; ++column) {
          normal[row * n + column] += at[i][l * l + row] * at[i][l * l + column];
          right[row * n + column] += at[i][l * l + row] * turned[i][l * l + column];
        }
      }
    }
    solve(normal, right, n);
    bands_[l] = std::move(right);
  }
}

void ShRotation::apply(std::span<glm::vec3> sh) const {
  TG_ASSERT(sh.size() == 1 || sh.size() == 4 || sh.size() == 9 || sh.size() == 16, "the coefficients of whole degrees");
  for (int l = 1; static_cast<std::size_t>(l * l) < sh.size(); ++l) {
    const int n = 2 * l + 1;
    std::array<glm::dvec3, 2 * kMaxDegree + 1> before;
    for (int k = 0; k < n; ++k) before[k] = glm::dvec3(sh[l * l + k]);
    for (int row = 0; row < n; ++row) {
      glm::dvec3 sum(0.0);
      for (int k = 0; k < n; ++k) sum += bands_[l][row * n + k] * before[k];
      sh[l * l + row] = glm::vec3(sum);
    }
  }
}

glm::ivec3 gltfAxisOrder(glm::vec3 log_scale) {
  const int c = shortestAxis(glm::exp(log_scale));
  return {axisU(c), axisV(c), c};
}

void orderAxesForGltf(glm::vec3& log_scale, glm::vec4& rotation) {
  const glm::ivec3 order = gltfAxisOrder(log_scale);
  if (order.z == 2) return;
  const glm::vec3 before = log_scale;
  log_scale = {before[order.x], before[order.y], before[order.z]};
  rotation = permuted(rotation, order, 2);
}

bool orderAxesForModel(glm::vec3& log_scale, glm::vec4& rotation) {
  const float shorter = glm::min(log_scale.x, log_scale.y);
  if (log_scale.z < shorter - kTieMargin) return true;
  if (log_scale.z > shorter) return false;
  putNormalFirst(log_scale, rotation, 2);
  return true;
}

void orderAxesForNormal(int normal, glm::vec3& log_scale, glm::vec4& rotation) {
  const glm::ivec3 now = gltfAxisOrder(log_scale);
  if (now.z != normal) {
    glm::ivec3 order(now.z);
    order[axisU(normal)] = now.x;
    order[axisV(normal)] = now.y;
    const glm::vec3 before = log_scale;
    log_scale = {before[order.x], before[order.y], before[order.z]};
    rotation = permuted(rotation, order, normal);
  }
  if (gltfAxisOrder(log_scale).z != normal) log_scale[normal] -= kTieMargin;
}

void putNormalFirst(glm::vec3& log_scale, glm::vec4& rotation, int normal) {
  TG_ASSERT(normal >= 0 && normal < 3, "one of three axes");
  const glm::ivec3 order(normal, axisU(normal), axisV(normal));
  const glm::vec3 before = log_scale;
  log_scale = {before[order.x], before[order.y], before[order.z]};
  rotation = permuted(rotation, order, 0);
}

}  // namespace tg
