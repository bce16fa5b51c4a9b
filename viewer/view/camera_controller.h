// SPDX-License-Identifier: Apache-2.0
// The viewer's camera: a pose that orbits, flies and frames, and a lens; pure functions, no window.
#pragma once
#include <glm/glm.hpp>
#include <span>

#include "core/model/camera.h"
#include "core/model/model.h"
#include "core/system/names.h"

namespace tg {

// The view direction is kept as angles against the scene's up, so that the horizon never tilts by accident. The pivot
// lies on the view axis, `distance` ahead of the camera.
struct ViewPose {
  glm::dmat3 world_from_level{1.0};  // columns: two horizontal axes, up; orthonormal, right-handed
  glm::dvec3 position{0.0};          // world units
  double yaw = 0;                    // [rad] heading, counter-clockwise around up
  double pitch = 0;                  // [rad] above the horizon
  double roll = 0;                   // [rad] around the view direction, clockwise as the image turns
  double distance = 1;               // [world units] to the pivot

  glm::dvec3 up() const { return world_from_level[2]; }
  glm::dvec3 forward() const;
  glm::dvec3 pivot() const { return position + distance * forward(); }
  glm::dmat3 cameraFromWorldRotation() const;
  bool operator==(const ViewPose&) const = default;
};

// What a pinhole camera is besides its pose, independent of the image size.
struct Lens {
  double fov_y = 0.9;       // [rad] over the whole image height
  double pixel_aspect = 1;  // fx / fy
  glm::dvec2 shift{0.0};    // (cx - width / 2) / fx, (cy - height / 2) / fy
  double kept = 1;  // width / height of the image in the middle that stays whole where the picture's shape changes
  bool operator==(const Lens&) const = default;
};

// A sphere around most of a scene.
struct SceneBounds {
  glm::dvec3 center{0.0};
  double radius = 1;
};

constexpr double kDegrees = 3.14159265358979323846 / 180.0;  // [rad]
constexpr double kMinFov = 0.05;                             // [rad] of the lens, either way
constexpr double kMaxFov = 2.6;
constexpr double kMaxPixelAspect = 1000;  // of the lens, fx / fy, either way
constexpr double kMaxShift = 1000;        // of its principal point, in focal lengths

// Median of the means; reach of 95 % of the Gaussians, or little more than of 80 %: no far floater makes it a dot.
SceneBounds sceneBounds(const GaussianModel& model);
// Mean of the cameras' image-up directions; where there are none or they cancel: -y, as COLMAP's scenes mostly stand.
glm::dvec3 sceneUp(std::span<const Camera> cameras);

// Which way is up.
enum class UpAxis { cameras, plusX, minusX, plusY, minusY, plusZ, minusZ };
constexpr auto namesOf(UpAxis) { return enumNames("cameras", "+x", "-x", "+y", "-y", "+z", "-z"); }
glm::dvec3 upOf(UpAxis axis, glm::dvec3 cameras_up);
// The same view with its horizon kept by another up.
ViewPose leveled(const ViewPose& pose, glm::dvec3 up);

// A level pose at `position` that looks at `target`.
ViewPose levelPose(glm::dvec3 up, glm::dvec3 position, glm::dvec3 target);
// The pose of a model's camera, roll included; the pivot is the point of its axis nearest to the scene's centre.
ViewPose poseOf(const Camera& camera, glm::dvec3 up, const SceneBounds& bounds);
// The lens of a model's camera for another aspect ratio: all the camera saw stays in the image.
Lens lensOf(const Camera& camera, double aspect);
// The lens of a picture of aspect ratio `from` for one of `to`: what is kept is as large as fits, as in
// web/src/camera.js.
Lens reshaped(const Lens& lens, double from, double to);

// `rotation`: camera from world. `scale`: what part of the image's height the lens fills.
Camera cameraAt(glm::dvec3 position, const glm::dmat3& rotation, const Lens& lens, double scale, int width, int height);
Camera toCamera(const ViewPose& pose, const Lens& lens, int width, int height);
// The same view at another size without distortion: scaled until the whole old image fits, more scene beside it.
Camera fitted(const Camera& camera, int width, int height);

void orbit(ViewPose& pose, double yaw, double pitch);  // [rad] around the pivot; stops short of the poles
void look(ViewPose& pose, double yaw, double pitch);   // [rad] around the camera
void pan(ViewPose& pose, double x, double y);          // [world units] image right and image down, pivot included
void dolly(ViewPose& pose, double factor);             // distance *= factor, towards the pivot
void fly(ViewPose& pose, glm::dvec3 offset);           // [world units] camera axes: right, down, forward
// The whole scene in the picture, behind the near plane [world units]; keeps the direction.
void frame(ViewPose& pose, const Lens& lens, double aspect, const SceneBounds& bounds, double near);
void dollyTo(ViewPose& pose, double factor, glm::dvec3 fixed);  // the same, and that point stays where it is seen
void centerOn(ViewPose& pose, glm::dvec3 point);  // moves sideways until the pivot is there; before the camera only
// Around the pivot to a side of the scene, `up` being up: front is where a level camera of x right, up up looks from.
enum class Side { front, back, left, right, top, bottom };
constexpr auto namesOf(Side) { return enumNames("front", "back", "left", "right", "top", "bottom"); }
void lookFrom(ViewPose& pose, Side side);
ViewPose startPose(glm::dvec3 up, const SceneBounds& bounds, const Lens& lens, double aspect, double near);

}  // namespace tg
