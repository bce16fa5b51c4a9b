// SPDX-License-Identifier: Apache-2.0
// Moves, turns and scales a model.
#include "converter/edit/transform.h"

#include <algorithm>
#include <cmath>

#include "converter/gltf/axes.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "shared/splat.h"

namespace tg {
namespace {

constexpr double kRigidTolerance = 1e-5;        // relative: matrices typed with six digits
constexpr std::int64_t kTransformGrain = 1024;  // Gaussians a thread takes at once

// Adds to all three logarithms. Where that leaves the normal's too close to another one, the model's rule
// (shared/splat.h) might pick another normal: local axes are then permuted so that it picks the same.
void addToLogScale(glm::vec3& log_scale, glm::vec4& rotation, double log_factor) {
  const int normal = shortestAxis(log_scale);
  for (int k = 0; k < 3; ++k) log_scale[k] = static_cast<float>(log_scale[k] + log_factor);
  const float shorter = std::min(log_scale[axisU(normal)], log_scale[axisV(normal)]);
  if (normal != 0 && log_scale[normal] >= shorter - kTieMargin) putNormalFirst(log_scale, rotation, normal);
}

// `count` Gaussians, the numbers of which `at` has.
template <typename At>
void transform(GaussianModel& model, const Similarity& similarity, std::size_t count, At at) {
  TG_ASSERT(similarity.scale > 0.0, "a scale above 0");
  TG_ASSERT(lengthsAgree(model), "the model's arrays have their lengths");
  const bool turns = similarity.rotation != glm::dmat3(1.0);
  const ShRotation sh_rotation(similarity.rotation);
  const glm::dvec4 turn = quaternionFromMatrix(similarity.rotation);
  const double log_factor = std::log(similarity.scale);
  const std::size_t coefficients = model.shCount();
  parallelFor(static_cast<std::int64_t>(count), kTransformGrain, [&](std::int64_t item) {
    const std::size_t i = at(static_cast<std::size_t>(item));
    model.mean[i] =
        glm::vec3(similarity.scale * (similarity.rotation * glm::dvec3(model.mean[i])) + similarity.translation);
    if (log_factor != 0.0) addToLogScale(model.log_scale[i], model.rotation[i], log_factor);
    if (!turns) return;
    model.rotation[i] = glm::vec4(multiply(turn, glm::dvec4(model.rotation[i])));
    sh_rotation.apply(std::span(model.sh).subspan(i * coefficients, coefficients));
  });
}

}  // namespace

Similarity about(Similarity similarity, glm::dvec3 point) {
  similarity.translation += point - similarity.scale * (similarity.rotation * point);
  return similarity;
}

Similarity similarityFrom(const glm::dmat4& m) {
  const auto fail = [](const char* what) {
    throw Error(ErrorKind::usage,
                std::string("the transform ") + what + " (expected a rotation, one positive scale, a translation)");
  };
  for (int k = 0; k < 16; ++k) {
    if (!std::isfinite(m[k / 4][k % 4])) fail("is not finite");
  }
  if (m[0][3] != 0.0 || m[1][3] != 0.0 || m[2][3] != 0.0 || m[3][3] != 1.0) fail("has a perspective");
  const glm::dmat3 linear(m);
  const glm::dvec3 lengths(glm::length(linear[0]), glm::length(linear[1]), glm::length(linear[2]));
  const double determinant = glm::determinant(linear);
  if (!std::isfinite(determinant)) fail("is too large");
  if (determinant == 0.0) fail("flattens space");
  if (determinant < 0.0) fail("mirrors");
  Similarity result;
  result.scale = std::cbrt(determinant);
  for (int k = 0; k < 3; ++k) {
    if (std::abs(lengths[k] / result.scale - 1.0) > kRigidTolerance) fail("scales axes differently");
  }
  const glm::dmat3 turned = linear / result.scale;
  const glm::dmat3 product = glm::transpose(turned) * turned;
  for (int k = 0; k < 9; ++k) {
    if (std::abs(product[k / 3][k % 3] - (k / 3 == k % 3 ? 1.0 : 0.0)) > kRigidTolerance) fail("shears");
  }
  result.rotation = matrixFromQuaternion(quaternionFromMatrix(turned));  // exactly orthonormal
  result.translation = glm::dvec3(m[3]);
  return result;
}

void transformModel(GaussianModel& model, const Similarity& similarity) {
  transform(model, similarity, model.size(), [](std::size_t item) { return item; });
}

void transformGaussians(GaussianModel& model, const Similarity& similarity, std::span<const std::uint32_t> which) {
  TG_ASSERT(std::ranges::all_of(which, [&](std::uint32_t i) { return i < model.size(); }), "Gaussians of the model");
  transform(model, similarity, which.size(), [which](std::size_t item) { return std::size_t{which[item]}; });
}

void transformCameras(std::vector<Camera>& cameras, const Similarity& similarity) {
  TG_ASSERT(similarity.scale > 0.0, "a scale above 0");
  for (Camera& camera : cameras) {
    // x_c = R x + t with x = S^T (y - d) / s; all of camera space grows by s, which no picture shows.
    camera.rotation = camera.rotation * glm::transpose(similarity.rotation);
    camera.translation = similarity.scale * camera.translation - camera.rotation * similarity.translation;
  }
}

}  // namespace tg
