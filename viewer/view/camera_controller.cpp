// SPDX-License-Identifier: Apache-2.0
// The viewer's camera: orbit, fly, pan, dolly, framing.
#include "viewer/view/camera_controller.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>

#include "core/system/assert.h"

namespace tg {
namespace {

constexpr double kMaxPitch = 1.55;     // [rad] 88.8 degrees: closer to the pole, yaw spins the picture in place
constexpr double kMinDistance = 1e-4;  // [world units]
constexpr double kMaxDistance = 1e9;
constexpr double kWidestPicture = 3.1415;  // [rad] of a lens in a strip of a picture
constexpr std::size_t kBoundsSample = 200'000;
constexpr double kInner = 0.8;        // a share of the Gaussians: with bounds that leave the others out,
constexpr double kBeyondInner = 1.1;  // [reach of the inner] they are that wide
constexpr double kFar = 2;            // [reach of the inner] what is left out goes at least so far,
constexpr double kLarge = 0.05;       // [reach of the inner] and half of it has at least that standard deviation

// Columns: two horizontal axes and up.
glm::dmat3 levelBasis(glm::dvec3 up) {
  TG_ASSERT(glm::length(up) > 0, "up is a direction");
  const glm::dvec3 u = glm::normalize(up);
  const glm::dvec3 helper = std::abs(u.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1);
  const glm::dvec3 e1 = glm::normalize(helper - glm::dot(helper, u) * u);
  return {e1, glm::cross(u, e1), u};
}

glm::dvec3 heading(const ViewPose& pose) {
  return std::cos(pose.yaw) * pose.world_from_level[0] + std::sin(pose.yaw) * pose.world_from_level[1];
}

// Moves within the limit, or back towards it when a model's camera stands beyond.
double turnedPitch(double pitch, double change) {
  const double low = std::min(-kMaxPitch, pitch), high = std::max(kMaxPitch, pitch);
  return std::clamp(pitch + change, low, high);
}

void turn(ViewPose& pose, double yaw, double pitch) {
  pose.yaw = std::remainder(pose.yaw + yaw, glm::two_pi<double>());
  pose.pitch = turnedPitch(pose.pitch, pitch);
}

double quantile(std::vector<double>& values, double q) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

glm::dvec3 ViewPose::forward() const { return std::cos(pitch) * heading(*this) + std::sin(pitch) * up(); }

glm::dmat3 ViewPose::cameraFromWorldRotation() const {
  const glm::dvec3 z = forward();
  const glm::dvec3 right = glm::cross(heading(*this), up());
  const glm::dvec3 down = glm::cross(z, right);
  const glm::dvec3 x = std::cos(roll) * right - std::sin(roll) * down;
  const glm::dvec3 y = std::sin(roll) * right + std::cos(roll) * down;
  return glm::transpose(glm::dmat3(x, y, z));
}

SceneBounds sceneBounds(const GaussianModel& model) {
  SceneBounds bounds;
  if (model.size() == 0) return bounds;
  // Enough of them, evenly spread, for quantiles: a large model should not wait for this.
  const std::size_t step = (model.size() + kBoundsSample - 1) / kBoundsSample;
  std::vector<double> values((model.size() + step - 1) / step);
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = model.mean[i * step][axis];
    bounds.center[axis] = quantile(values, 0.5);
  }
  const auto sigma = [&](std::size_t i) {
    const glm::vec3 s = model.log_scale[i * step];
    return std::exp(double{std::max({s.x, s.y, s.z})});
  };
  std::vector<double> reach(values.size());
  for (std::size_t i = 0; i < reach.size(); ++i) {
    reach[i] = glm::length(glm::dvec3(model.mean[i * step]) - bounds.center) + 2.0 * sigma(i);
  }
  values = reach;
  const double inner = quantile(values, kInner);
  bounds.radius = quantile(values, 0.95);
  if (bounds.radius > kFar * inner) {
    // A scene without an end has large Gaussians far behind its subject, which from beyond them is seen through haze.
    // Small ones are a sparse part of the subject.
    values.clear();
    for (std::size_t i = 0; i < reach.size(); ++i) {
      if (reach[i] > inner) values.push_back(sigma(i));
    }
    if (quantile(values, 0.5) > kLarge * inner) bounds.radius = kBeyondInner * inner;
  }
  bounds.radius = std::clamp(bounds.radius, kMinDistance, kMaxDistance);
  return bounds;
}

glm::dvec3 sceneUp(std::span<const Camera> cameras) {
  glm::dvec3 sum(0.0);
  for (const Camera& camera : cameras) sum -= glm::transpose(camera.rotation)[1];
  const double length = glm::length(sum);
  return length > 0.1 * static_cast<double>(cameras.size()) ? sum / length : glm::dvec3(0, -1, 0);
}

glm::dvec3 upOf(UpAxis axis, glm::dvec3 cameras_up) {
  if (axis == UpAxis::cameras) return cameras_up;
  const int index = static_cast<int>(axis) - 1;  // +x, -x, +y, ...
  glm::dvec3 up(0.0);
  up[index / 2] = index % 2 == 0 ? 1 : -1;
  return up;
}

ViewPose leveled(const ViewPose& pose, glm::dvec3 up) {
  ViewPose result = levelPose(up, pose.position, pose.pivot());
  result.distance = pose.distance;
  return result;
}

ViewPose levelPose(glm::dvec3 up, glm::dvec3 position, glm::dvec3 target) {
  ViewPose pose;
  pose.world_from_level = levelBasis(up);
  pose.position = position;
  const glm::dvec3 offset = target - position;
  pose.distance = std::clamp(glm::length(offset), kMinDistance, kMaxDistance);
  const glm::dvec3 level = glm::transpose(pose.world_from_level) * offset;
  pose.yaw = std::atan2(level.y, level.x);
  pose.pitch = std::atan2(level.z, std::hypot(level.x, level.y));
  return pose;
}

ViewPose poseOf(const Camera& camera, glm::dvec3 up, const SceneBounds& bounds) {
  const glm::dmat3 world_from_camera = glm::transpose(camera.rotation);
  const glm::dvec3 position = camera.position();
  const glm::dvec3 z = world_from_camera[2];
  const double distance = std::max(glm::dot(bounds.center - position, z), 0.1 * bounds.radius);
  ViewPose pose = levelPose(up, position, position + z);
  pose.distance = std::clamp(distance, kMinDistance, kMaxDistance);
  // Straight up or down the heading is free: take it so that there is no roll.
  if (std::hypot(glm::dot(z, pose.world_from_level[0]), glm::dot(z, pose.world_from_level[1])) < 1e-9) {
    const glm::dvec3 image_up = -world_from_camera[1] * (pose.pitch < 0 ? 1.0 : -1.0);
    pose.yaw = std::atan2(glm::dot(image_up, pose.world_from_level[1]), glm::dot(image_up, pose.world_from_level[0]));
  }
  const glm::dvec3 right = glm::cross(heading(pose), pose.up());
  const glm::dvec3 down = glm::cross(pose.forward(), right);
  pose.roll = std::atan2(-glm::dot(world_from_camera[0], down), glm::dot(world_from_camera[0], right));
  return pose;
}

Lens lensOf(const Camera& camera, double aspect) {
  TG_ASSERT(camera.size.x > 0 && camera.size.y > 0 && aspect > 0, "a picture has pixels");
  const double scale = std::min(aspect * camera.size.y / camera.size.x, 1.0);  // of the old image in a new height of 1
  Lens lens;
  lens.fov_y = std::clamp(2.0 * std::atan(camera.size.y / (2.0 * scale * camera.focal.y)), kMinFov, kMaxFov);
  lens.pixel_aspect = std::clamp(camera.focal.x / camera.focal.y, 1 / kMaxPixelAspect, kMaxPixelAspect);
  lens.shift = glm::clamp((camera.center - 0.5 * glm::dvec2(camera.size)) / camera.focal, -kMaxShift, kMaxShift);
  lens.kept = static_cast<double>(camera.size.x) / camera.size.y;
  return lens;
}

Lens reshaped(const Lens& lens, double from, double to) {
  TG_ASSERT(from > 0 && to > 0, "a picture has pixels");
  const double change = std::min(from / lens.kept, 1.0) / std::min(to / lens.kept, 1.0);
  Lens result = lens;
  // Not within the limits of a lens: the next shape, after a strip of a few pixels, brings back the view of before.
  if (change != 1.0) result.fov_y = std::min(2.0 * std::atan(std::tan(0.5 * lens.fov_y) * change), kWidestPicture);
  return result;
}

Camera cameraAt(glm::dvec3 position, const glm::dmat3& rotation, const Lens& lens, double scale, int width,
                int height) {
  TG_ASSERT(width > 0 && height > 0, "a picture has pixels");
  TG_ASSERT(lens.fov_y > 0 && lens.fov_y < glm::pi<double>() && lens.pixel_aspect > 0, "a lens of a pinhole");
  Camera camera;
  camera.size = {width, height};
  camera.focal.y = 0.5 * height * scale / std::tan(0.5 * lens.fov_y);
  camera.focal.x = camera.focal.y * lens.pixel_aspect;
  camera.center = 0.5 * glm::dvec2(camera.size) + lens.shift * camera.focal;
  camera.rotation = rotation;
  camera.translation = -rotation * position;
  return camera;
}

Camera toCamera(const ViewPose& pose, const Lens& lens, int width, int height) {
  return cameraAt(pose.position, pose.cameraFromWorldRotation(), lens, 1, width, height);
}

Camera fitted(const Camera& camera, int width, int height) {
  TG_ASSERT(camera.size.x > 0 && camera.size.y > 0, "the camera has a size to scale from");
  const glm::dvec2 ratio = glm::dvec2(width, height) / glm::dvec2(camera.size);
  return scaled(camera, std::min(ratio.x, ratio.y), width, height);
}

void orbit(ViewPose& pose, double yaw, double pitch) {
  if (yaw == 0 && pitch == 0) return;  // not even by a rounding: that would be another view
  const glm::dvec3 center = pose.pivot();
  turn(pose, yaw, pitch);
  pose.position = center - pose.distance * pose.forward();
}

void look(ViewPose& pose, double yaw, double pitch) { turn(pose, yaw, pitch); }

void pan(ViewPose& pose, double x, double y) { fly(pose, {x, y, 0}); }

void dolly(ViewPose& pose, double factor) {
  TG_ASSERT(factor > 0, "a distance stays above 0");
  const glm::dvec3 center = pose.pivot();
  pose.distance = std::clamp(pose.distance * factor, kMinDistance, kMaxDistance);
  pose.position = center - pose.distance * pose.forward();
}

void dollyTo(ViewPose& pose, double factor, glm::dvec3 fixed) {
  TG_ASSERT(factor > 0, "a distance stays above 0");
  const double before = pose.distance;
  pose.distance = std::clamp(before * factor, kMinDistance, kMaxDistance);
  pose.position = fixed + (pose.position - fixed) * (pose.distance / before);
}

void centerOn(ViewPose& pose, glm::dvec3 point) {
  const double depth = glm::dot(point - pose.position, pose.forward());
  if (!(depth > 0)) return;
  pose.distance = std::clamp(depth, kMinDistance, kMaxDistance);
  pose.position = point - pose.distance * pose.forward();
}

void lookFrom(ViewPose& pose, Side side) {
  const glm::dvec3 center = pose.pivot();
  constexpr double kQuarter = glm::half_pi<double>();
  // Headings against world_from_level, whose second axis points away from who stands in front.
  const bool level = side != Side::top && side != Side::bottom;
  pose.pitch = level ? 0 : side == Side::top ? -kQuarter : kQuarter;
  pose.yaw = side == Side::back    ? -kQuarter
             : side == Side::left  ? 0
             : side == Side::right ? glm::pi<double>()
                                   : kQuarter;
  pose.roll = 0;
  pose.position = center - pose.distance * pose.forward();
}

void fly(ViewPose& pose, glm::dvec3 offset) {
  pose.position += glm::transpose(pose.cameraFromWorldRotation()) * offset;
}

void frame(ViewPose& pose, const Lens& lens, double aspect, const SceneBounds& bounds, double near) {
  TG_ASSERT(aspect > 0 && bounds.radius >= 0, "a picture and a scene have sizes");
  const double half_y = 0.5 * lens.fov_y;
  const double half_x = std::atan(std::tan(half_y) * aspect / lens.pixel_aspect);
  // The near plane must not cut into small models.
  pose.distance = std::clamp(std::max(bounds.radius / std::sin(std::min(half_x, half_y)), bounds.radius + 1.5 * near),
                             kMinDistance, kMaxDistance);
  pose.position = bounds.center - pose.distance * pose.forward();
}

ViewPose startPose(glm::dvec3 up, const SceneBounds& bounds, const Lens& lens, double aspect, double near) {
  ViewPose pose = levelPose(up, bounds.center, bounds.center + glm::dvec3(0, 0, 1));
  pose.pitch = -0.3;
  frame(pose, lens, aspect, bounds, near);
  return pose;
}

}  // namespace tg
