// SPDX-License-Identifier: Apache-2.0
// Key frames joined with continuous velocities, and their files.
#include "viewer/view/camera_path.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <glm/gtc/constants.hpp>
#include <nlohmann/json.hpp>

#include "converter/lod/lod_scene.h"
#include "converter/registry/file_format.h"
#include "core/bundle/camera_file.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxPathBytes = std::uint64_t{32} << 20;
constexpr int kPathVersion = 1;
constexpr double kUnitTolerance = 1e-3;  // files carry rotations rounded to some digits
constexpr double kVelocityLimit = 3;     // x the slower neighbouring segment: monotone (Fritsch and Carlson 1980)

// From one key to the next, the wrap of a closed path included.
struct Segment {
  std::size_t from = 0, to = 0;
  double seconds = 0;
};

std::size_t segmentCount(const CameraPath& path) {
  return path.keys.size() < 2 ? 0 : path.keys.size() - (path.closing > 0 ? 0 : 1);
}

Segment segmentAt(const CameraPath& path, std::size_t index) {
  const std::size_t to = (index + 1) % path.keys.size();
  const double seconds = to == 0 ? path.closing : path.keys[to].time - path.keys[index].time;
  return {index, to, seconds};
}

// The segments that end and begin at a key; each missing at the end of an open path.
struct Neighbours {
  std::optional<Segment> before, after;
};

Neighbours neighbours(const CameraPath& path, std::size_t key) {
  const std::size_t segments = segmentCount(path);
  const bool closed = path.closing > 0;
  Neighbours result;
  if (key > 0 || closed) result.before = segmentAt(path, (key + path.keys.size() - 1) % path.keys.size());
  if (key < segments) result.after = segmentAt(path, key);
  return result;
}

// The velocity at a key whose neighbouring segments move by `before` and `after` on average: the slope of the parabola
// through the three keys (non-uniform Catmull-Rom), limited.
template <typename V>
V velocity(const V& before, const V& after, double seconds_before, double seconds_after) {
  const V mean = (seconds_after * before + seconds_before * after) / (seconds_before + seconds_after);
  const double limit = kVelocityLimit * std::min(glm::length(before), glm::length(after));
  const double speed = glm::length(mean);
  return speed > limit ? mean * (limit / speed) : mean;
}

// The velocity at a key, from the average velocity of a segment.
template <typename V, typename Average>
V velocityAt(const CameraPath& path, std::size_t key, const Average& average) {
  const Neighbours near = neighbours(path, key);
  if (!near.before && !near.after) return V(0.0);
  if (!near.before) return average(*near.after);
  if (!near.after) return average(*near.before);
  return velocity(average(*near.before), average(*near.after), near.before->seconds, near.after->seconds);
}

// Cubic Hermite segment; u in [0, 1], velocities per second.
template <typename V>
V hermite(const V& from, const V& to, const V& leaving, const V& arriving, double seconds, double u) {
  const double u2 = u * u, u3 = u2 * u;
  return (2 * u3 - 3 * u2 + 1) * from + (u3 - 2 * u2 + u) * seconds * leaving + (3 * u2 - 2 * u3) * to +
         (u3 - u2) * seconds * arriving;
}

// A segment of whatever `valueOf` finds in a key.
template <typename V, typename ValueOf>
V between(const CameraPath& path, const Segment& segment, double u, const ValueOf& valueOf) {
  const auto average = [&](const Segment& s) {
    return (valueOf(path.keys[s.to]) - valueOf(path.keys[s.from])) / s.seconds;
  };
  return hermite<V>(valueOf(path.keys[segment.from]), valueOf(path.keys[segment.to]),
                    velocityAt<V>(path, segment.from, average), velocityAt<V>(path, segment.to, average),
                    segment.seconds, u);
}

// Rotation vector [rad] of a unit quaternion, the shorter way round, and back.
glm::dvec3 logarithm(glm::dquat q) {
  if (q.w < 0) q = -q;
  const glm::dvec3 v(q.x, q.y, q.z);
  const double sine = glm::length(v);
  return sine < 1e-12 ? 2.0 * v : v * (2.0 * std::atan2(sine, q.w) / sine);
}

glm::dquat exponential(const glm::dvec3& v) {
  const double angle = glm::length(v);
  if (angle < 1e-12) return glm::normalize(glm::dquat(1, 0.5 * v.x, 0.5 * v.y, 0.5 * v.z));
  const glm::dvec3 axis = v / angle;
  const double s = std::sin(0.5 * angle);
  return {std::cos(0.5 * angle), s * axis.x, s * axis.y, s * axis.z};
}

glm::dquat rotationBetween(const CameraPath& path, const Segment& segment, double u) {
  const auto average = [&](const Segment& s) {
    return logarithm(path.keys[s.to].world_from_camera * glm::conjugate(path.keys[s.from].world_from_camera)) /
           s.seconds;
  };
  const glm::dvec3 leaving = velocityAt<glm::dvec3>(path, segment.from, average);
  const glm::dvec3 arriving = velocityAt<glm::dvec3>(path, segment.to, average);
  const glm::dquat a = path.keys[segment.from].world_from_camera, d = path.keys[segment.to].world_from_camera;
  const double third = segment.seconds / 3.0;
  const glm::dquat b = exponential(third * leaving) * a, c = exponential(-third * arriving) * d;
  const auto mix = [u](const glm::dquat& p, const glm::dquat& q) { return glm::slerp(p, q, u); };
  const glm::dquat ab = mix(a, b), bc = mix(b, c), cd = mix(c, d);
  return glm::normalize(mix(mix(ab, bc), mix(bc, cd)));
}

// (log tan(fov / 2), log pixel aspect, shift)
glm::dvec4 lensValues(const Lens& lens) {
  return {std::log(std::tan(0.5 * lens.fov_y)), std::log(lens.pixel_aspect), lens.shift.x, lens.shift.y};
}

Lens lensFrom(const glm::dvec4& values) {
  Lens lens;
  lens.fov_y = std::clamp(2.0 * std::atan(std::exp(values.x)), kMinFov, kMaxFov);
  lens.pixel_aspect = std::exp(values.y);
  lens.shift = {values.z, values.w};
  return lens;
}

PathKey parseKey(const JsonNode& json) {
  PathKey key;
  key.time = json.number("time", 0, kMaxPathSeconds);
  const auto [x, y, z] = json.numbers<3>("position", -kMaxCoordinate, kMaxCoordinate);
  key.position = {x, y, z};
  const std::array<double, 4> q = json.numbers<4>("rotation", -1.5, 1.5);
  key.world_from_camera = glm::dquat(q[0], q[1], q[2], q[3]);
  if (std::abs(glm::length(key.world_from_camera) - 1.0) > kUnitTolerance) {
    json.fail("\"rotation\": expected a quaternion of length 1, found " + json.member("rotation").dump());
  }
  key.world_from_camera = glm::normalize(key.world_from_camera);
  key.lens.fov_y = json.number("fov_y", kMinFov / kDegrees, kMaxFov / kDegrees) * kDegrees;
  if (json.has("pixel_aspect")) {
    key.lens.pixel_aspect = json.number("pixel_aspect", 1 / kMaxPixelAspect, kMaxPixelAspect);
  }
  if (json.has("shift")) {
    const auto [right, down] = json.numbers<2>("shift", -kMaxShift, kMaxShift);
    key.lens.shift = {right, down};
  }
  return key;
}

bool beginsAsJson(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  char first = 0;
  stream >> first;                         // but white space
  return first == '{' || first == '\xef';  // or a byte order mark
}

// Any JSON may begin as a format does that is JSON, too: such a one is a model by its name.
bool isModel(const std::filesystem::path& file) {
  try {
    const Format& format = detectFormat(file);
    if (!format.is_common || !beginsAsJson(file)) return true;
    return lowerCase(file.filename().string()).ends_with(extensionOf(format));
  } catch (const Error& error) {
    if (error.kind != ErrorKind::badData) throw;
    return false;
  }
}

std::vector<Camera> camerasOf(const std::filesystem::path& model) {
  if (!isLodMeta(model)) return readModel(model).cameras;
  return readLodCameras(readLodScene(model), lodFolderReader(model));
}

}  // namespace

double duration(const CameraPath& path) {
  return path.keys.empty() ? 0.0 : path.keys.back().time - path.keys.front().time + path.closing;
}

PathKey at(const CameraPath& path, double seconds) {
  TG_ASSERT(!path.keys.empty(), "a path has a key");
  const double whole = duration(path);
  if (segmentCount(path) == 0 || !(whole > 0)) return path.keys.front();
  double t = path.closing > 0 ? std::fmod(seconds, whole) : std::clamp(seconds, 0.0, whole);
  if (t < 0) t += whole;
  const double time = path.keys.front().time + t;
  const auto next = std::upper_bound(path.keys.begin(), path.keys.end(), time,
                                     [](double value, const PathKey& key) { return value < key.time; });
  const auto index = static_cast<std::size_t>(next - path.keys.begin()) - 1;
  const Segment segment = segmentAt(path, std::min(index, segmentCount(path) - 1));
  const double u = std::clamp((time - path.keys[segment.from].time) / segment.seconds, 0.0, 1.0);
  PathKey key;
  key.time = time;
  key.position = between<glm::dvec3>(path, segment, u, [](const PathKey& k) { return k.position; });
  key.world_from_camera = rotationBetween(path, segment, u);
  key.lens = lensFrom(between<glm::dvec4>(path, segment, u, [](const PathKey& k) { return lensValues(k.lens); }));
  return key;
}

PathKey keyOf(const Camera& camera, double time) {
  return keyOf(camera, time, static_cast<double>(camera.size.x) / camera.size.y);
}

PathKey keyOf(const Camera& camera, double time, double aspect) {
  TG_ASSERT(camera.size.x > 0 && camera.size.y > 0, "a picture has pixels");
  PathKey key;
  key.time = time;
  key.position = camera.position();
  key.world_from_camera = glm::normalize(glm::quat_cast(glm::transpose(camera.rotation)));
  key.lens = lensOf(camera, aspect);
  key.lens.kept = Lens().kept;  // the path's aspect says it
  return key;
}

Camera toCamera(const PathKey& key, double aspect, int width, int height) {
  TG_ASSERT(aspect > 0, "a path has an aspect");
  // What lensOf does for a camera: a narrower image is scaled down until the old one fits.
  const double scale = std::min(static_cast<double>(width) / height / aspect, 1.0);
  return cameraAt(key.position, glm::transpose(glm::mat3_cast(key.world_from_camera)), key.lens, scale, width, height);
}

std::vector<Camera> pathCameras(const CameraPath& path, double fps, int width, int height) {
  TG_ASSERT(fps > 0 && !path.keys.empty(), "a path has a key, a recording a rate");
  const double exact = duration(path) * fps;
  const double count = path.closing > 0 ? std::max(std::round(exact), 1.0) : std::floor(exact + 1e-6) + 1;
  if (!(count <= static_cast<double>(kMaxPathFrames))) {
    char found[32];
    std::snprintf(found, sizeof found, "%.0f", count);
    throw Error(ErrorKind::usage, "the path is too long at this frame rate (expected at most " +
                                      std::to_string(kMaxPathFrames) + " frames, found " + found + ")");
  }
  std::vector<Camera> cameras;
  cameras.reserve(static_cast<std::size_t>(count));
  for (double frame = 0; frame < count; ++frame) {
    cameras.push_back(toCamera(at(path, frame / fps), path.aspect, width, height));
  }
  return cameras;
}

std::vector<Camera> turntableCameras(const ViewPose& start, const Lens& lens, int frames, int width, int height) {
  TG_ASSERT(frames > 0, "a turn has a view");
  std::vector<Camera> cameras;
  cameras.reserve(static_cast<std::size_t>(frames));
  for (int frame = 0; frame < frames; ++frame) {
    ViewPose pose = start;  // from the start every time: no error adds up
    orbit(pose, 2.0 * glm::pi<double>() * frame / frames, 0);
    cameras.push_back(toCamera(pose, lens, width, height));
  }
  return cameras;
}

CameraPath pathOf(std::span<const Camera> cameras, double seconds, const std::string& path) {
  if (cameras.empty()) throw Error(ErrorKind::badData, path, "no camera inside (expected at least 1, found 0)");
  if (cameras.size() > kMaxPathKeys) {
    throw Error(ErrorKind::badData, path,
                "too many cameras (expected at most " + std::to_string(kMaxPathKeys) + ", found " +
                    std::to_string(cameras.size()) + ")");
  }
  CameraPath result;
  result.aspect = static_cast<double>(cameras.front().size.x) / cameras.front().size.y;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    result.keys.push_back(keyOf(cameras[i], seconds * static_cast<double>(i), result.aspect));
  }
  return result;
}

std::vector<Camera> keyCameras(const CameraPath& path, int height) {
  TG_ASSERT(height > 0, "a picture has pixels");
  const int width = std::max(static_cast<int>(height * path.aspect), 1);
  std::vector<Camera> cameras;
  cameras.reserve(path.keys.size());
  for (const PathKey& key : path.keys) {
    char name[32];
    std::snprintf(name, sizeof name, "key%03zu", cameras.size());
    cameras.push_back(toCamera(key, static_cast<double>(width) / height, width, height));
    cameras.back().name = name;
  }
  return cameras;
}

CameraPath parsePath(const std::string& json, const std::string& file) {
  const nlohmann::json root = parseJson(json, file);
  if (root.is_array()) return pathOf(parseCameras(json, file), 1.0, file);
  const JsonNode object{root, file, ""};
  if (!root.is_object()) object.fail(std::string("expected a camera path, found ") + root.type_name());
  if (object.string("format") != "tgview-path") {
    object.fail("\"format\": expected \"tgview-path\", found " + object.member("format").dump());
  }
  (void)object.integer("version", kPathVersion, kPathVersion);
  CameraPath path;
  path.aspect = object.number("aspect", 1e-3, 1e3);
  path.closing = object.has("closing") ? object.number("closing", 0, kMaxPathSeconds) : 0;
  const nlohmann::json& keys = object.member("keys");
  if (!keys.is_array() || keys.empty() || keys.size() > kMaxPathKeys) {
    object.fail("\"keys\": expected an array of 1 to " + std::to_string(kMaxPathKeys) + " keys");
  }
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const JsonNode entry{keys[i], file, "key " + std::to_string(i)};
    path.keys.push_back(parseKey(entry));
    if (i > 0 && !(path.keys[i].time >= path.keys[i - 1].time + 0.999 * kLeastKeySeconds)) {
      entry.fail("\"time\": expected at least 1 ms after the key before it");
    }
  }
  if (path.closing > 0 && path.closing < 0.999 * kLeastKeySeconds) {
    object.fail("\"closing\": expected 0 or at least 1 ms");
  }
  return path;
}

std::string formatPath(const CameraPath& path) {
  using nlohmann::ordered_json;
  std::string text = "{\"format\":\"tgview-path\",\"version\":" + std::to_string(kPathVersion) +
                     ",\"aspect\":" + ordered_json(path.aspect).dump() +
                     ",\"closing\":" + ordered_json(path.closing).dump() + ",\"keys\":[\n";  // a key a line
  for (std::size_t i = 0; i < path.keys.size(); ++i) {
    const PathKey& key = path.keys[i];
    const glm::dquat& q = key.world_from_camera;
    const ordered_json json = {{"time", key.time},
                               {"position", {key.position.x, key.position.y, key.position.z}},
                               {"rotation", {q.w, q.x, q.y, q.z}},
                               {"fov_y", key.lens.fov_y / kDegrees},
                               {"pixel_aspect", key.lens.pixel_aspect},
                               {"shift", {key.lens.shift.x, key.lens.shift.y}}};
    text += dumpJson(json) + (i + 1 < path.keys.size() ? ",\n" : "\n");
  }
  return text + "]}\n";
}

bool isPathFile(const std::filesystem::path& file) {
  const std::vector<std::uint8_t> bytes = readFile(file, kMaxPathBytes);
  const std::string text(bytes.begin(), bytes.end());
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  return first != std::string::npos && text[first] == '{';
}

CameraPath readPath(const std::filesystem::path& file) {
  if (isModel(file)) {
    const std::vector<Camera> cameras = camerasOf(file);
    if (!cameras.empty()) return pathOf(cameras, 1.0, file.string());
    throw Error(ErrorKind::badData, file.string(),
                "the model has no cameras to fly along (expected one at least, a camera path or a cameras.json)");
  }
  const std::vector<std::uint8_t> bytes = readFile(file, kMaxPathBytes);
  return parsePath(std::string(bytes.begin(), bytes.end()), file.string());
}

void appendKey(CameraPath& path, PathKey key, double seconds) {
  if (path.keys.size() >= kMaxPathKeys) {
    throw Error(ErrorKind::usage, "the path is full (expected at most " + std::to_string(kMaxPathKeys) + " keys)");
  }
  key.time = path.keys.empty() ? 0.0 : path.keys.back().time + std::max(seconds, kLeastKeySeconds);
  if (key.time > kMaxPathSeconds) {
    throw Error(ErrorKind::usage,
                formatted("the path is too long (expected its last key within %.0f s)", kMaxPathSeconds));
  }
  path.keys.push_back(key);
}

void removeKey(CameraPath& path, std::size_t index) {
  TG_ASSERT(index < path.keys.size(), "the path has this key");
  path.keys.erase(path.keys.begin() + static_cast<std::ptrdiff_t>(index));
  if (path.keys.empty()) return;
  const double start = path.keys.front().time;
  for (PathKey& key : path.keys) key.time -= start;
}

double keySeconds(const CameraPath& path, std::size_t index) {
  TG_ASSERT(index < path.keys.size(), "the path has this key");
  return index + 1 < path.keys.size() ? path.keys[index + 1].time - path.keys[index].time : path.closing;
}

void setKeySeconds(CameraPath& path, std::size_t index, double seconds) {
  TG_ASSERT(index < path.keys.size(), "the path has this key");
  if (index + 1 == path.keys.size()) {
    path.closing = seconds <= 0 ? 0.0 : std::max(seconds, kLeastKeySeconds);
    return;
  }
  const double change =
      std::min(std::max(seconds, kLeastKeySeconds) - keySeconds(path, index), kMaxPathSeconds - path.keys.back().time);
  for (std::size_t i = index + 1; i < path.keys.size(); ++i) path.keys[i].time += change;
}

}  // namespace tg
