// SPDX-License-Identifier: Apache-2.0
// Cameras made, moved and scaled.
#include "core/model/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/system/assert.h"

namespace tg {
namespace {

// Times the power of two that brings the largest component to 1/2 or above and below 1, so that squares neither
// overflow nor vanish. Exact: the direction has the bits of the vector's own.
glm::dvec3 scaledToOne(const glm::dvec3& v) {
  int exponent = 0;
  std::frexp(std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}), &exponent);
  return {std::ldexp(v.x, -exponent), std::ldexp(v.y, -exponent), std::ldexp(v.z, -exponent)};
}

}  // namespace

Camera lookAt(glm::dvec3 eye, glm::dvec3 target, glm::dvec3 up, double fov_y_radians, int width, int height) {
  TG_ASSERT(eye != target, "a camera looks at another place than its own");
  TG_ASSERT(fov_y_radians > 0.0 && fov_y_radians < std::numbers::pi, "a field of view in (0, pi)");
  TG_ASSERT(width > 0 && height > 0, "a picture has pixels");
  const bool too_far = glm::any(glm::isinf(target - eye));
  const glm::dvec3 ahead = too_far ? 0.5 * target - 0.5 * eye : target - eye;
  const glm::dvec3 z = glm::normalize(scaledToOne(ahead));
  up = scaledToOne(up);
  glm::dvec3 right = glm::cross(z, up);
  // Looking along `up`: any horizontal direction will do, but always the same one.
  if (glm::length(right) < 1e-9 * glm::length(up)) {
    right = glm::cross(z, std::abs(z.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1));
  }
  const glm::dvec3 x = glm::normalize(right);
  const glm::dvec3 y = glm::cross(z, x);
  Camera camera;
  camera.size = {width, height};
  camera.focal = glm::dvec2(0.5 * height / std::tan(0.5 * fov_y_radians));
  camera.center = 0.5 * glm::dvec2(camera.size);
  camera.rotation = glm::transpose(glm::dmat3(x, y, z));
  camera.translation = -camera.rotation * eye;
  return camera;
}

Camera resized(const Camera& camera, int width, int height) {
  TG_ASSERT(camera.size.x > 0 && camera.size.y > 0, "the camera has a size to scale from");
  TG_ASSERT(width > 0 && height > 0, "a picture has pixels");
  Camera result = camera;
  result.size = {width, height};
  const glm::dvec2 scale = glm::dvec2(result.size) / glm::dvec2(camera.size);
  result.focal *= scale;
  result.center *= scale;
  return result;
}

Camera scaled(const Camera& camera, double scale, int width, int height) {
  TG_ASSERT(scale > 0 && width > 0 && height > 0, "a picture has pixels");
  Camera result = camera;
  result.size = {width, height};
  result.focal *= scale;
  result.center = (camera.center - 0.5 * glm::dvec2(camera.size)) * scale + 0.5 * glm::dvec2(result.size);
  return result;
}

}  // namespace tg
