// SPDX-License-Identifier: Apache-2.0
// A pinhole camera.
#pragma once
#include <glm/glm.hpp>
#include <string>

namespace tg {

// OpenCV axes: x right, y down, z forward. Pixel centres at +0.5, the image's left edge at x = 0.
struct Camera {
  std::string name;  // of the image, without path; may be empty
  int width = 0;     // [px]
  int height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;                // [px]
  glm::dmat3 camera_from_world_rotation{1.0};           // orthonormal, det +1
  glm::dvec3 camera_from_world_translation{0.0};
  bool test = false;                                    // held out from training

  glm::dvec3 position() const { return -glm::transpose(camera_from_world_rotation) * camera_from_world_translation; }
};

// A camera at `eye` that looks at `target`; `up` points to the image's top. Intrinsics from the vertical field of view.
Camera lookAt(glm::dvec3 eye, glm::dvec3 target, glm::dvec3 up, double fov_y_radians, int width, int height);

// The same view at another image size: intrinsics scaled per axis.
Camera resized(const Camera& camera, int width, int height);

}  // namespace tg
