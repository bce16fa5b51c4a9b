// SPDX-License-Identifier: Apache-2.0
// The view of one picture; paths and turntables as lists of cameras.
#include "viewer/view/shot.h"

#include <cmath>

#include "core/system/error.h"
#include "viewer/view/camera_path.h"
#include "viewer/view/parse.h"
#include "viewer/view/state.h"

namespace tg {
namespace {

constexpr glm::ivec2 kDefaultSize(1280, 720);
constexpr int kPathRows = 720;  // [px] of a path's pictures where nothing else is said

// Checked after rounding to even sides, which may be the pixel too many.
glm::ivec2 shotSize(glm::ivec2 size, bool even) {
  if (even) size = (size + 1) / 2 * 2;
  if (!isImageSize(size.x, size.y)) {
    throw Error(ErrorKind::usage, "--size: the frames are too large (found " + std::to_string(size.x) + "x" +
                                      std::to_string(size.y) + ")");
  }
  return size;
}

std::vector<Camera> pathShot(const ViewOptions& options, bool even) {
  const CameraPath path = readPath(options.path);
  const double width = std::max(1.0, std::round(path.aspect * kPathRows));
  const glm::ivec2 size = shotSize(options.size.value_or(glm::ivec2(static_cast<int>(width), kPathRows)), even);
  try {
    return pathCameras(path, options.fps, size.x, size.y);
  } catch (const Error& error) {
    throw Error(error.kind, options.path.string(), error.what());
  }
}

}  // namespace

Camera cameraFor(const ViewOptions& options, const Scene& scene) {
  std::string which = options.camera;
  if (which.empty() && !scene.cameras.empty()) which = std::to_string(startCamera(scene.cameras));
  if (which.empty()) {
    const glm::ivec2 size = options.size.value_or(kDefaultSize);
    const Lens lens;
    const double aspect = static_cast<double>(size.x) / size.y;
    const double near = options.settings.near;
    return toCamera(startPose(scene.up, scene.bounds, lens, aspect, near), lens, size.x, size.y);
  }
  if (options.up_given && options.turntable == 0) {
    throw Error(ErrorKind::usage,
                "--up: does nothing for the view of a camera (expected a model without cameras, or --turntable)");
  }
  const Camera camera = cameraOf(which, scene.cameras, "--camera");
  if (!isImageSize(camera.size.x, camera.size.y)) {
    throw Error(ErrorKind::badData, "--camera " + which,
                "image size (expected " + imageSizeLimits() + ", found " + std::to_string(camera.size.x) + "x" +
                    std::to_string(camera.size.y) + ")");
  }
  return options.size ? fitted(camera, options.size->x, options.size->y) : camera;
}

RenderSettings settingsFor(const ViewOptions& options, glm::vec3 background) {
  RenderSettings settings = options.settings;
  settings.background = options.background.value_or(background);
  settings.outputs = {options.show};
  return settings;
}

ViewPose turntableStart(const ViewOptions& options, const Scene& scene, const Camera& camera) {
  ViewPose pose = poseOf(camera, scene.up, scene.bounds);
  if (options.elevation) {
    pose.pitch = -*options.elevation;
    pose.roll = 0;
  }
  if (options.radius) pose.distance = *options.radius;
  if (options.elevation || options.radius) pose.position = scene.bounds.center - pose.distance * pose.forward();
  return pose;
}

std::vector<Camera> shotCameras(const ViewOptions& options, const Scene& scene, bool even) {
  if (!options.path.empty()) return pathShot(options, even);
  const Camera start = cameraFor(options, scene);
  const glm::ivec2 size = shotSize(start.size, even);
  const Lens lens = lensOf(start, static_cast<double>(size.x) / size.y);
  return turntableCameras(turntableStart(options, scene, start), lens, options.turntable, size.x, size.y);
}

}  // namespace tg
