// SPDX-License-Identifier: Apache-2.0
// Camera paths: key frames, what lies between them, their files, and the turntable. Pure functions, no window.
#pragma once
#include <filesystem>
#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "viewer/view/camera_controller.h"

namespace tg {

constexpr std::size_t kMaxPathKeys = 10000;
constexpr std::size_t kMaxPathFrames = 100000;  // of a recording, a benchmark
constexpr double kMaxPathSeconds = 24 * 3600;
constexpr double kMaxCoordinate = 1e9;     // [world units] of a key's position, each axis
constexpr double kLeastKeySeconds = 1e-3;  // between keys

struct PathKey {
  double time = 0;                           // [s]; keys are in order of it, kLeastKeySeconds or more apart
  glm::dvec3 position{0.0};                  // world units
  glm::dquat world_from_camera{1, 0, 0, 0};  // unit
  Lens lens;                                 // for an image of the path's aspect, which is what it keeps
  bool operator==(const PathKey&) const = default;
};

struct CameraPath {
  std::vector<PathKey> keys;
  double aspect = 16.0 / 9.0;  // width / height that the lenses were set for: all of that image stays in view
  double closing = 0;          // [s] from the last key back to the first; 0: the path is open
  bool operator==(const CameraPath&) const = default;
};

double duration(const CameraPath& path);  // [s] first key to last, closing included
// The path `seconds` after its first key. An open path stands still beyond its ends, a closed one goes round. Passes
// through every key with one velocity on both sides of it: cubic Hermite segments for position and lens (focal length
// in its logarithm), cubic Bezier curves by slerp for the rotation (Shoemake 1985), with the velocities of the
// non-uniform Catmull-Rom spline, limited so that a key that repeats its neighbour stands still. Needs a key or more.
PathKey at(const CameraPath& path, double seconds);

PathKey keyOf(const Camera& camera, double time);                 // for a path of its aspect
PathKey keyOf(const Camera& camera, double time, double aspect);  // for one of another
// Of a key at an image size: the path's whole image is in view, undistorted.
Camera toCamera(const PathKey& key, double aspect, int width, int height);

// What a recording at `fps` draws: an open path from its first key to its last, both included; a closed one once round,
// without the first picture again. Throws Error(usage) for more than kMaxPathFrames.
std::vector<Camera> pathCameras(const CameraPath& path, double fps, int width, int height);
// `frames` views once round the pivot of `start`, the first of them `start` itself, counter-clockwise around its up.
std::vector<Camera> turntableCameras(const ViewPose& start, const Lens& lens, int frames, int width, int height);

// Keys at the cameras, `seconds` apart; the aspect of the first. Throws Error(badData) for none, naming `path`.
CameraPath pathOf(std::span<const Camera> cameras, double seconds, const std::string& path);
// The keys as cameras of that image height, named key000 and so on: for the tools that read cameras.json.
std::vector<Camera> keyCameras(const CameraPath& path, int height);

// docs/viewer.md has the format. parsePath also takes a cameras.json: its cameras are keys, one second apart. Throws
// Error(badData) with key and member, Error(cannotRead).
CameraPath parsePath(const std::string& json, const std::string& file);
std::string formatPath(const CameraPath& path);
bool isPathFile(const std::filesystem::path& file);  // a JSON object, not a list of cameras; throws Error(cannotRead)
// The same of a file, or of a model's own cameras as keys, one second apart. Throws what readModel throws, too.
CameraPath readPath(const std::filesystem::path& file);

// Edits that keep the order of the keys.
// At the end, `seconds` after the last one. Throws Error(usage) beyond kMaxPathKeys.
void appendKey(CameraPath& path, PathKey key, double seconds);
void removeKey(CameraPath& path, std::size_t index);
// Changes how long the path takes from key `index` to the next one; later keys move with it.
void setKeySeconds(CameraPath& path, std::size_t index, double seconds);
double keySeconds(const CameraPath& path, std::size_t index);  // [s] to the next key; of the last one: closing

}  // namespace tg
