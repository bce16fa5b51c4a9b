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
glm::dvec4 quaternionFromMatrix(const glm::dmat3& m);
// The rotation that applies `a` after `b`.
glm::dvec4 multiply(glm::dvec4 a, glm::dvec4 b);

// Turns functions on the sphere: after apply(), the function's value at R d is what it was at d.
class ShRotation {
 public:
  explicit ShRotation(const glm::dmat3& rotation);
  void apply(std::span<glm::vec3> sh) const;  // one Gaussian's coefficients, degree 0 first

 private:
  std::vector<double> bands_[4];  // bands_[l]: (2l+1) x (2l+1), row-major; [0] unused
};

// ---- Which local axes carry a texture: the model finds them by sorting scales (docs/math.md), glTF by their place.

// The local axes that become x, y and z there: u, v and the normal.
glm::ivec3 gltfAxisOrder(glm::vec3 log_scale);

// Permutes local axes so that x = u, y = v and z = normal, for one Gaussian; the handedness is kept by
// turning the normal, whose sign means nothing. Textures stay as they are.
void orderAxesForGltf(glm::vec3& log_scale, glm::vec4& rotation);

// The same Gaussian with axes that the model's rule maps back to u = x, v = y: unchanged where z is clearly the
// shortest, (z, x, y) where it ties. False when z is not the shortest: the rule then picks other axes.
bool orderAxesForModel(glm::vec3& log_scale, glm::vec4& rotation);

// The same Gaussian with its texture's normal as axis `normal` of 0, 1 and 2, and u and v on the same axes in space.
// The normal's scale becomes kTieMargin less where another ties with it and the model's rule would pick that axis.
void orderAxesForNormal(int normal, glm::vec3& log_scale, glm::vec4& rotation);

// Scales closer than this are taken for a tie: backends compare exp(log_scale) in float, each with its own rounding.
constexpr float kTieMargin = 1e-5f;  // of ln(sigma)

// The same Gaussian with its normal, local axis `normal`, as x and u, v as y, z: what the model's rule finds even where
// the normal's scale equals others.
void putNormalFirst(glm::vec3& log_scale, glm::vec4& rotation, int normal);

}  // namespace tg
