// SPDX-License-Identifier: Apache-2.0
// Cameras in and out: what callers hand in is checked as what files say.
#include "textured_gaussians/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/model/rotation.h"
#include "library/access.h"

namespace textured_gaussians {
namespace {

constexpr int kMaxSide = 65536;              // [px]
constexpr double kRotationTolerance = 1e-3;  // of a product of two rows, as in files
constexpr std::int64_t kMaxPixels = tg::kMaxImagePixels;

[[noreturn]] void refuse(const std::string& camera, const std::string& what) {
  throw Error(ErrorKind::usage, tg::printable("camera" + (camera.empty() ? "" : " " + camera) + ": " + what));
}

}  // namespace

tg::Camera cameraOf(const Camera& camera) {
  if (camera.width < 1 || camera.height < 1 || camera.width > kMaxSide || camera.height > kMaxSide ||
      std::int64_t{camera.width} * camera.height > kMaxPixels) {
    refuse(camera.name, "no picture has this size (expected 1 to 65536 pixels a side and at most 2^28, found " +
                            std::to_string(camera.width) + " x " + std::to_string(camera.height) + ")");
  }
  if (!allFinite(camera.rotation) || !allFinite(camera.translation) || !allFinite(camera.focal) ||
      !allFinite(camera.center)) {
    refuse(camera.name, "a number is not finite");
  }
  if (camera.focal[0] <= 0 || camera.focal[1] <= 0) refuse(camera.name, "expected focal lengths above 0");
  tg::Camera result;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      result.rotation[column][row] = camera.rotation[static_cast<std::size_t>(3 * row + column)];
    }
  }
  if (tg::skewOf(glm::transpose(result.rotation)) > kRotationTolerance) {
    refuse(camera.name, "the rotation's rows are not orthonormal");
  }
  if (glm::determinant(result.rotation) < 0) refuse(camera.name, "the rotation is a reflection (determinant -1)");
  result.translation = {camera.translation[0], camera.translation[1], camera.translation[2]};
  result.focal = {camera.focal[0], camera.focal[1]};
  result.center = {camera.center[0], camera.center[1]};
  result.size = {camera.width, camera.height};
  result.name = camera.name;
  result.test = camera.test;
  return result;
}

Camera cameraOf(const tg::Camera& camera) {
  Camera result;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      result.rotation[static_cast<std::size_t>(3 * row + column)] = camera.rotation[column][row];
    }
  }
  result.translation = {camera.translation.x, camera.translation.y, camera.translation.z};
  result.focal = {camera.focal.x, camera.focal.y};
  result.center = {camera.center.x, camera.center.y};
  result.width = camera.size.x;
  result.height = camera.size.y;
  result.name = camera.name;
  result.test = camera.test;
  return result;
}

Camera lookAt(const std::array<double, 3>& eye, const std::array<double, 3>& target, const std::array<double, 3>& up,
              double fov_y, int width, int height) {
  if (!allFinite(eye) || !allFinite(target) || !allFinite(up)) refuse("", "a number is not finite");
  if (eye == target) refuse("", "expected a target away from the eye");
  if (up == std::array<double, 3>{}) refuse("", "expected a direction for up");
  if (!(fov_y > 0 && fov_y < std::numbers::pi)) refuse("", "expected a field of view above 0 and below pi");
  if (width < 1 || height < 1) refuse("", "expected a picture of at least 1 x 1 pixels");
  const auto vector = [](const std::array<double, 3>& v) { return glm::dvec3(v[0], v[1], v[2]); };
  const Camera camera = cameraOf(tg::lookAt(vector(eye), vector(target), vector(up), fov_y, width, height));
  (void)cameraOf(camera);
  return camera;
}

}  // namespace textured_gaussians
