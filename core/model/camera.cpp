// SPDX-License-Identifier: Apache-2.0
// Cameras made, moved and scaled.
#include "core/model/camera.h"

#include <cmath>
#include <numbers>

#include "core/system/assert.h"

namespace tg {

Camera lookAt(glm::dvec3 eye, glm::dvec3 target, glm::dvec3 up, double fov_y_radians, int width, int height) {
  TG_ASSERT(eye != target, "a camera looks at another place than its own");
  TG_ASSERT(fov_y_radians > 0.0 && fov_y_radians < std::numbers::pi, "a field of view in (0, pi)");
  TG_ASSERT(width > 0 && height > 0, "a picture has pixels");
  const glm::dvec3 z = glm::normalize(target - eye);
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
