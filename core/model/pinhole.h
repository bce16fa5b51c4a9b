// SPDX-License-Identifier: Apache-2.0
// The pinhole camera as plain data: renderers, kernels and training take it as it is.
#pragma once
#include <glm/glm.hpp>

namespace tg {

// OpenCV axes: x right, y down, z forward. Pixel centres lie at +0.5, the image's left edge at x = 0.
struct Pinhole {
  glm::dmat3 rotation{1.0};     // camera from world; orthonormal, det +1
  glm::dvec3 translation{0.0};  // camera from world
  glm::dvec2 focal{0.0};        // [px]
  glm::dvec2 center{0.0};       // [px]
  glm::ivec2 size{0};           // [px]

  glm::dvec3 position() const { return -glm::transpose(rotation) * translation; }  // world space
  bool operator==(const Pinhole&) const = default;
};

// GLM's qualifier lets CUDA kernels call these functions, too.
GLM_FUNC_QUALIFIER glm::dvec3 cameraFromWorld(const Pinhole& camera, glm::dvec3 point) {
  return camera.rotation * point + camera.translation;
}
// Where a point of camera space lies in the image [px].
GLM_FUNC_QUALIFIER glm::dvec2 project(const Pinhole& camera, glm::dvec3 point) {
  return glm::dvec2(point) / point.z * camera.focal + camera.center;
}
// The direction in camera space through a place in the image [px], scaled so that its z is 1.
GLM_FUNC_QUALIFIER glm::dvec3 ray(const Pinhole& camera, glm::dvec2 pixel) {
  return {(pixel - camera.center) / camera.focal, 1.0};
}
// fx, fy, cx, cy [px], as shaders/shared takes them.
GLM_FUNC_QUALIFIER glm::vec4 focalCenter(const Pinhole& camera) { return {camera.focal, camera.center}; }

}  // namespace tg
