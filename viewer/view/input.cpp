// SPDX-License-Identifier: Apache-2.0
// What the mouse and held keys do to the camera.
#include "viewer/view/input.h"

#include <algorithm>
#include <cmath>

namespace tg {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kRollSpeed = 0.8;     // [rad / s]
constexpr double kWheelFactor = 0.88;  // of the distance, per notch
constexpr double kMostNotches = 100;   // of one frame
constexpr double kTurnSpeed = 1.2;     // [rad / s] by arrow keys
constexpr double kPanSpeed = 0.6;      // [picture heights / s] by arrow keys

// What is seen there, at the pivot's depth.
glm::dvec3 pointUnder(const ViewerState& state, glm::dvec2 cursor, int height) {
  const ViewPose& pose = state.camera.pose;
  const Lens& lens = state.camera.lens;
  const double focal = 0.5 * std::max(height, 1) / std::tan(0.5 * lens.fov_y);
  const glm::dvec2 ray = cursor / glm::dvec2(focal * lens.pixel_aspect, focal) - lens.shift;
  return pose.position +
         glm::transpose(pose.cameraFromWorldRotation()) * (pose.distance * glm::dvec3(ray.x, ray.y, 1.0));
}

void useArrows(ViewerState& state, const Input& input) {
  ViewPose& pose = state.camera.pose;
  const glm::dvec2 turn = input.arrows * kTurnSpeed * input.seconds;
  if (input.shift) {
    const double units = 2.0 * pose.distance * std::tan(0.5 * state.camera.lens.fov_y) * kPanSpeed * input.seconds;
    pan(pose, input.arrows.x * units, -input.arrows.y * units);
  } else if (state.camera.fly) {
    look(pose, -turn.x, turn.y);
  } else {
    orbit(pose, turn.x, -turn.y);
  }
}

}  // namespace

bool applyInput(ViewerState& state, const Input& input, int height) {
  const ViewPose before = state.camera.pose;
  const Lens lens_before = state.camera.lens;
  const double radians_per_pixel = kPi / std::max(height, 1);
  const glm::dvec2 drag = input.drag;
  if (input.middle || (input.left && input.shift)) {
    // A point at the pivot's distance stays under the pointer.
    const double units_per_pixel =
        2.0 * state.camera.pose.distance * std::tan(0.5 * state.camera.lens.fov_y) / std::max(height, 1);
    pan(state.camera.pose, -drag.x * units_per_pixel / state.camera.lens.pixel_aspect, -drag.y * units_per_pixel);
  } else if (input.left && !state.camera.fly) {
    orbit(state.camera.pose, -drag.x * radians_per_pixel, -drag.y * radians_per_pixel);
  } else if (input.left || input.right) {
    look(state.camera.pose, -drag.x * radians_per_pixel, -drag.y * radians_per_pixel);
  }
  if (input.wheel != 0 && input.control) {
    state.camera.lens.fov_y = std::clamp(state.camera.lens.fov_y * std::pow(0.95, input.wheel), kMinFov, kMaxFov);
  } else if (input.wheel != 0) {
    dollyTo(state.camera.pose, std::pow(kWheelFactor, std::clamp(input.wheel, -kMostNotches, kMostNotches)),
            pointUnder(state, input.cursor, height));
  }
  if (input.arrows != glm::dvec2(0.0)) useArrows(state, input);
  const double boost = input.shift ? 4.0 : input.alt ? 0.25 : 1.0;
  const double step = state.camera.speed * boost * state.scene.bounds.radius * input.seconds;
  if (input.fly != glm::dvec3(0.0)) fly(state.camera.pose, input.fly * step);
  state.camera.pose.roll = std::remainder(state.camera.pose.roll + input.roll * kRollSpeed * input.seconds, 2.0 * kPi);

  const bool moved = state.camera.pose.position != before.position || state.camera.pose.yaw != before.yaw ||
                     state.camera.pose.pitch != before.pitch || state.camera.pose.roll != before.roll ||
                     state.camera.lens.fov_y != lens_before.fov_y;
  if (moved) {
    leaveCamera(state.camera);
    state.path.playing = false;
  }
  return moved;
}

}  // namespace tg
