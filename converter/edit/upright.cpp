// SPDX-License-Identifier: Apache-2.0
// Which way is up, by the cameras that took a model's photographs.
#include "converter/edit/upright.h"

#include <cmath>

namespace tg {
namespace {

constexpr double kLeastTop = 0.1;     // length of the mean of the cameras' tops: below, they contradict
constexpr double kLeastSpread = 0.1;  // of the right sides over the plane, against 0.5: below, they are one direction
constexpr double kLeastLevel = 0.5;   // cosine between the tops' mean and the axis: below, the rights say nothing
constexpr int kRounds = 64;           // of a power iteration
constexpr double kOpposite = 1e-9;    // length of the sum of two unit vectors: below, it has no direction

}  // namespace

std::optional<glm::dvec3> upOf(std::span<const Camera> cameras) {
  glm::dvec3 top(0.0);
  glm::dmat3 rights(0.0);
  for (const Camera& camera : cameras) {
    const glm::dmat3 axes = glm::transpose(camera.rotation);  // columns: the camera's axes in the world
    top -= axes[1];
    rights += glm::outerProduct(axes[0], axes[0]);
  }
  const auto count = static_cast<double>(cameras.size());
  if (cameras.empty() || !(glm::length(top) > kLeastTop * count)) return std::nullopt;
  top = glm::normalize(top);
  // The eigenvector of the smallest eigenvalue of the right sides' second moments, which add up to 1.
  const glm::dmat3 rest = glm::dmat3(1.0) - rights / count;
  glm::dvec3 axis = top;
  for (int round = 0; round < kRounds; ++round) axis = glm::normalize(rest * axis);
  // In the plane at right angles the smaller moment is their determinant over the larger, which is 1/2 at least.
  const double least = glm::dot(axis, rights * axis) / count;
  const double sum = 1.0 - least, squares = [&] {
    double norm = 0;
    for (int k = 0; k < 3; ++k) norm += glm::dot(rights[k], rights[k]) / (count * count);
    return norm - least * least;
  }();
  const double spread = 0.5 * (sum - std::sqrt(std::max(0.0, 2.0 * squares - sum * sum)));
  if (spread < kLeastSpread || glm::dot(axis, top) < kLeastLevel) return top;
  return axis;
}

glm::dmat3 turnBetween(glm::dvec3 from, glm::dvec3 to) {
  const glm::dvec3 sum = from + to;
  const double squared = glm::dot(sum, sum);
  if (squared < kOpposite * kOpposite) {  // any axis at right angles: always the same one
    const glm::dvec3 axis =
        glm::normalize(glm::cross(from, std::abs(from.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1)));
    return 2.0 * glm::outerProduct(axis, axis) - glm::dmat3(1.0);
  }
  // Neither the cross product nor 1 + cosine loses digits by way of the sum.
  const glm::dvec3 cross = glm::cross(from, sum);
  const glm::dmat3 skew(0, cross.z, -cross.y, -cross.z, 0, cross.x, cross.y, -cross.x, 0);
  return glm::dmat3(1.0) + skew + skew * skew / (0.5 * squared);
}

}  // namespace tg
