// SPDX-License-Identifier: Apache-2.0
// Rotations as files have them: rounded.
#pragma once
#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>

namespace tg {

// The largest difference of the product of a matrix's transpose with it from the identity: 0 for a rotation.
inline double skewOf(const glm::dmat3& matrix) {
  const glm::dmat3 gram = glm::transpose(matrix) * matrix;
  double skew = 0.0;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) skew = std::max(skew, std::abs(gram[i][j] - (i == j ? 1.0 : 0.0)));
  }
  return skew;
}

// The rotation that a matrix of little skew and a determinant above 0 is the rounding of (Gram-Schmidt).
inline glm::dmat3 orthonormalized(const glm::dmat3& matrix) {
  const glm::dvec3 x = glm::normalize(matrix[0]);
  const glm::dvec3 y = glm::normalize(matrix[1] - x * glm::dot(x, matrix[1]));
  return {x, y, glm::cross(x, y)};
}

}  // namespace tg
