// SPDX-License-Identifier: Apache-2.0
// Between the model's world (COLMAP: x right, y down, z forward) and glTF's (+y up, +z forward, -x right): a half turn
// about z, exact in floating point; and rotations of spherical harmonics for node transforms.
#pragma once
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace tg {

// The half turn is its own inverse, except that a quaternion comes back with the opposite sign: two functions.
inline glm::vec3 turnAxes(glm::vec3 p) { return {-p.x, -p.y, p.z}; }
inline glm::dvec3 turnAxes(glm::dvec3 p) { return {-p.x, -p.y, p.z}; }
// Quaternions w, x, y, z in .x .y .z .w, as in core/model/model.h: (0, 0, 0, 1) * q and (0, 0, 0, -1) * q.
inline glm::vec4 gltfFromModelRotation(glm::vec4 q) { return {-q.w, -q.z, q.y, q.x}; }
inline glm::vec4 modelFromGltfRotation(glm::vec4 q) { return {q.w, q.z, -q.y, -q.x}; }
// Coefficients of one Gaussian, degree 0 first. Its own inverse.
void turnShAxes(std::span<glm::vec3> sh);

// q as a matrix (columns: rotated axes) and back. q = w, x, y, z of any length > 0; the result is of unit length.
glm::dmat3 matrixFromQuaternion(glm::dvec4 q);
glm::dvec4 quaternionFromMatrix(const glm::dmat3& rotation);
// The rotation that applies `second` after `first`.
glm::dvec4 multiply(glm::dvec4 second, glm::dvec4 first);

// Turns functions on the sphere: after apply(), the function's value at R d is what it was at d.
class ShRotation {
 public:
  explicit ShRotation(const glm::dmat3& rotation);
  void apply(std::span<glm::vec3> sh) const;  // one Gaussian's coefficients, degree 0 first

 private:
  std::vector<double> bands_[4];  // bands_[l]: (2l+1) x (2l+1), row-major; [0] unused
};

}  // namespace tg
