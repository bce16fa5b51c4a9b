// SPDX-License-Identifier: Apache-2.0
// Gaussians as mass, mean and covariance, by which several become one.
#include "core/merge/moments.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "core/model/verbs.h"

namespace tg {
namespace {

constexpr double kLargestSigma = 1e50;

// Eigenvalues, and eigenvectors as columns, of a symmetric matrix: cyclic Jacobi rotations.
glm::dvec3 eigen(glm::dmat3 m, glm::dmat3& vectors) {
  vectors = glm::dmat3(1.0);
  for (int sweep = 0; sweep < 12; ++sweep) {
    for (const auto& [p, q] : {std::array<int, 2>{0, 1}, {0, 2}, {1, 2}}) {
      if (m[p][q] == 0.0) continue;
      const double theta = 0.5 * (m[q][q] - m[p][p]) / m[p][q];
      const double t = (theta >= 0.0 ? 1.0 : -1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1.0));
      const double c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
      glm::dmat3 turn(1.0);
      turn[p][p] = turn[q][q] = c;
      turn[q][p] = s;  // column q, row p
      turn[p][q] = -s;
      m = glm::transpose(turn) * m * turn;
      vectors = vectors * turn;
    }
  }
  return {m[0][0], m[1][1], m[2][2]};
}

// Of a symmetric matrix whose elements are at most of the order of 1: O. K. Smith, "Eigenvalues of a symmetric 3 x 3
// matrix", Communications of the ACM 4 (1961).
double largestEigenvalue(const glm::dmat3& m) {
  const double mean = (m[0][0] + m[1][1] + m[2][2]) / 3.0;
  const glm::dmat3 from = m - glm::dmat3(mean);
  const double squares = glm::dot(from[0], from[0]) + glm::dot(from[1], from[1]) + glm::dot(from[2], from[2]);
  const double spread = std::sqrt(squares / 6.0);
  if (!(spread > 0.0)) return mean;
  const double cosine = glm::determinant(from / spread) / 2.0;
  return mean + 2.0 * spread * std::cos(std::acos(std::clamp(cosine, -1.0, 1.0)) / 3.0);
}

}  // namespace

glm::dvec3 boundedSigma(const GaussianModel& model, std::size_t i) {
  return glm::min(sigmaOf(model, i), glm::dvec3(kLargestSigma));
}

double areaOf(glm::dvec3 sigma) {
  std::sort(&sigma[0], &sigma[0] + 3);
  return sigma.y * sigma.z;
}

// Of the covariance's eigenvalues the product of the two largest is the largest of its adjugate.
double areaOf(const GaussianMoments& moments) {
  const glm::dmat3& covariance = moments.covariance;
  const double scale = covariance[0][0] + covariance[1][1] + covariance[2][2];
  if (!(scale > kLeastVariance)) return kLeastVariance;
  const glm::dmat3 m = covariance / scale;
  const glm::dmat3 adjugate(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
  const double longest = std::max({m[0][0], m[1][1], m[2][2]}), least = kLeastVariance / scale;
  return scale * std::sqrt(std::max(largestEigenvalue(adjugate), std::max(longest, least) * least));
}

GaussianMoments momentsOf(const GaussianModel& model, std::size_t i, double alpha) {
  glm::dmat3 axes = axesOf(model, i);
  const glm::dvec3 sigma = boundedSigma(model, i);
  for (int k = 0; k < 3; ++k) axes[k] *= sigma[k];
  return {std::max(opacityOf(model, i) * alpha * areaOf(sigma), kLeastMass), glm::dvec3(model.mean[i]),
          axes * glm::transpose(axes)};
}

GaussianMoments merged(const GaussianMoments& a, const GaussianMoments& b) {
  GaussianMoments m;
  m.mass = a.mass + b.mass;
  const double p = a.mass / m.mass, q = b.mass / m.mass;
  m.mean = p * a.mean + q * b.mean;
  const glm::dvec3 d = a.mean - b.mean;
  m.covariance = p * a.covariance + q * b.covariance + p * q * glm::outerProduct(d, d);
  return m;
}

glm::dvec3 sigmaOf(const GaussianMoments& moments, glm::dmat3& axes) {
  return glm::sqrt(glm::max(eigen(moments.covariance, axes), glm::dvec3(kLeastVariance)));
}

static_assert(kFieldCount == 5, "a merged Gaussian would keep the new parameter of one: here, or where SH are merged");

void setMoments(GaussianModel& model, std::size_t i, const GaussianMoments& moments) {
  glm::dmat3 axes;
  const glm::dvec3 sigma = sigmaOf(moments, axes);
  if (glm::determinant(axes) < 0.0) axes[2] = -axes[2];
  model.mean[i] = glm::vec3(moments.mean);
  const glm::dquat q = glm::quat_cast(axes);
  model.rotation[i] = glm::vec4(q.w, q.x, q.y, q.z);
  model.log_scale[i] = glm::vec3(glm::log(sigma));
  const double opacity = std::min(moments.mass / areaOf(sigma), kMostMergedOpacity);
  model.opacity_logit[i] = static_cast<float>(std::log(opacity) - std::log1p(-opacity));
}

}  // namespace tg
