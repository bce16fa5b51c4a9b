// SPDX-License-Identifier: Apache-2.0
// A pinhole camera, and the cameras.json that INRIA's viewers share.
#pragma once
#include <filesystem>
#include <glm/glm.hpp>
#include <string>
#include <vector>

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

// INRIA layout: [{id, img_name, width, height, position, rotation (world from camera, rows), fx, fy}], plus our optional
// cx, cy, split ("train" / "test") and translation (camera from world: survives files exactly, which -R * position does
// not); cx, cy default to the image centre. Throws Error(badData) with index and key.
std::vector<Camera> parseCameras(const std::string& json, const std::string& path);
std::string formatCameras(const std::vector<Camera>& cameras);
std::vector<Camera> readCameras(const std::filesystem::path& path);

}  // namespace tg
