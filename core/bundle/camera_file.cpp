// SPDX-License-Identifier: Apache-2.0
// Checks what a file says of a camera, and writes it back to the last digit.
#include "core/bundle/camera_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/file/json.h"
#include "core/model/rotation.h"
#include "core/system/error.h"

namespace tg {
namespace {

// Files carry rotations rounded to 6 or 7 digits; anything worse is no rotation.
constexpr double kRotationTolerance = 1e-3;
constexpr double kRoundedRotation = 1e-5;

// glm stores columns, and camera_from_world[column r] is row r of its transpose, world_from_camera: what the file
// holds.
glm::dmat3 parseRotation(const JsonNode& camera) {
  const nlohmann::json& rows = camera.array("rotation", 3);
  glm::dmat3 camera_from_world;
  for (int r = 0; r < 3; ++r) {
    const nlohmann::json& row = rows[static_cast<std::size_t>(r)];
    if (!row.is_array() || row.size() != 3) camera.fail("\"rotation\": expected 3 rows of 3 numbers");
    for (int c = 0; c < 3; ++c) camera_from_world[r][c] = camera.finite(row[static_cast<std::size_t>(c)], "rotation");
  }
  if (!(skewOf(camera_from_world) <= kRotationTolerance)) camera.fail("\"rotation\": rows are not orthonormal");
  if (glm::determinant(camera_from_world) < 0.0) camera.fail("\"rotation\": is a reflection (determinant -1)");
  return camera_from_world;
}

glm::dvec3 parseVector(const JsonNode& camera, const char* key) {
  const std::array<double, 3> v = camera.numbers<3>(key);
  return {v[0], v[1], v[2]};
}

Camera parseCamera(const JsonNode& json) {
  Camera camera;
  camera.name = json.string("img_name");
  camera.size = {json.integer("width", 1, kMaxCameraSide), json.integer("height", 1, kMaxCameraSide)};
  camera.focal = {json.number("fx"), json.number("fy")};
  if (camera.focal.x <= 0.0 || camera.focal.y <= 0.0) json.fail("\"fx\", \"fy\": expected focal lengths above 0");
  camera.center.x = json.has("cx") ? json.number("cx") : 0.5 * camera.size.x;
  camera.center.y = json.has("cy") ? json.number("cy") : 0.5 * camera.size.y;
  const glm::dmat3 stored = parseRotation(json);
  // Of three digits, its transpose is no inverse: eye and depths would disagree. Of more, the numbers stay the file's.
  camera.rotation = skewOf(stored) > kRoundedRotation ? orthonormalized(stored) : stored;
  const glm::dvec3 position = parseVector(json, "position");
  camera.translation = -camera.rotation * position;
  if (json.has("translation")) {
    // The exact value; the position is its rounded image and must not have been edited alone.
    const glm::dvec3 exact = parseVector(json, "translation");
    const double tolerance = 1e-3 * (1.0 + glm::length(exact));
    if (!(glm::length(exact + stored * position) <= tolerance)) json.fail("\"translation\" and \"position\" disagree");
    camera.translation = exact;
  }
  if (json.has("split")) {
    const std::string split = json.string("split");
    if (split != "train" && split != "test") {
      json.fail("\"split\": expected \"train\" or \"test\", found \"" + split + "\"");
    }
    camera.test = split == "test";
  }
  return camera;
}

}  // namespace

std::vector<Camera> parseCameras(const std::string& json, const std::string& path) {
  const nlohmann::json root = parseJson(json, path);
  if (!root.is_array()) {
    throw Error(ErrorKind::badData, path, std::string("expected an array of cameras, found ") + root.type_name());
  }
  std::vector<Camera> cameras;
  cameras.reserve(root.size());
  for (std::size_t i = 0; i < root.size(); ++i) {
    cameras.push_back(parseCamera({root[i], path, "camera " + std::to_string(i)}));
  }
  return cameras;
}

std::string formatCameras(const std::vector<Camera>& cameras) {
  using nlohmann::ordered_json;
  const auto vector = [](const glm::dvec3& v) { return ordered_json{v.x, v.y, v.z}; };
  std::string text = "[\n";  // a camera a line
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera& camera = cameras[i];
    const glm::dmat3& r = camera.rotation;
    const ordered_json json = {{"id", i},
                               {"img_name", camera.name},
                               {"width", camera.size.x},
                               {"height", camera.size.y},
                               {"position", vector(camera.position())},
                               {"rotation", {vector(r[0]), vector(r[1]), vector(r[2])}},
                               {"fx", camera.focal.x},
                               {"fy", camera.focal.y},
                               {"cx", camera.center.x},
                               {"cy", camera.center.y},
                               {"translation", vector(camera.translation)},
                               {"split", camera.test ? "test" : "train"}};
    text += dumpJson(json) + (i + 1 < cameras.size() ? ",\n" : "\n");
  }
  return text + "]\n";
}

std::string storedCameras(const std::vector<Camera>& cameras, const std::string& path) {
  std::string text = formatCameras(cameras);
  if (text.size() > kMaxCamerasBytes) {
    throw Error(
        ErrorKind::cannotWrite, path,
        std::to_string(cameras.size()) + " cameras make a cameras.json that is too large" +
            expectedFound("at most " + std::to_string(kMaxCamerasBytes) + " bytes", std::to_string(text.size())));
  }
  try {
    parseCameras(text, "cameras.json");
  } catch (const Error& error) {
    throw Error(ErrorKind::cannotWrite, path, error.what());
  }
  return text;
}

std::vector<Camera> readCameras(const std::filesystem::path& path) {
  const std::vector<std::uint8_t> bytes = readFile(path, kMaxCamerasBytes);
  return parseCameras(std::string(bytes.begin(), bytes.end()), path.string());
}

}  // namespace tg
