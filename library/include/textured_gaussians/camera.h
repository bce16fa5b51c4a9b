// SPDX-License-Identifier: Apache-2.0
// Where a picture is taken from.
#pragma once
#include <array>
#include <string>

namespace textured_gaussians {

// A pinhole camera. Its axes are x right, y down, z forward; pixel centres lie at +0.5, the image's left edge at x = 0.
// A point p of the world appears at (x / z, y / z) * focal + center [px], with (x, y, z) = rotation p + translation.
struct Camera {
  std::array<double, 9> rotation = {1, 0, 0, 0, 1,
                                    0, 0, 0, 1};  // [3, 3], row after row: camera from world, orthonormal
  std::array<double, 3> translation = {0, 0, 0};  // camera from world [world units]
  std::array<double, 2> focal = {0, 0};           // x, y [px], above 0
  std::array<double, 2> center = {0, 0};          // x, y [px]
  int width = 0;                                  // [px], 1 to 65,536, as height; width times height at most 2^28
  int height = 0;                                 // [px]
  std::string name;                               // of the photograph, without its folder; may be empty
  bool test = false;                              // held out from training
};

// A camera at `eye` that looks at `target`, both in world space; `up` points to the picture's top. `fov_y`: the
// vertical field of view [radians], above 0 and below pi. Throws Error(usage) for values that make no camera.
Camera lookAt(const std::array<double, 3>& eye, const std::array<double, 3>& target, const std::array<double, 3>& up,
              double fov_y, int width, int height);

}  // namespace textured_gaussians
