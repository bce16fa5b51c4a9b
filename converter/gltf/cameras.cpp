// SPDX-License-Identifier: Apache-2.0
// Cameras as glTF camera nodes, and back.
#include "converter/gltf/cameras.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "converter/gltf/axes.h"

namespace tg {
namespace {

constexpr int kDefaultRows = 720;  // [px] of a camera that states no image size
constexpr double kDefaultAspect = 16.0 / 9.0;
constexpr int kMaxSide = 1 << 16;  // [px]
constexpr double kZNear = 0.01;    // glTF demands both; no reader of splats cuts by them
constexpr double kZFar = 1000.0;

// glTF cameras look along -z with y up, ours along +z with y down: a half turn about x.
glm::dmat3 turnCameraAxes(glm::dmat3 world_from_camera) {
  world_from_camera[1] *= -1.0;
  world_from_camera[2] *= -1.0;
  return world_from_camera;
}
// The half turn of axes.h on the world side.
glm::dmat3 turnWorldAxes(glm::dmat3 world_from_camera) {
  for (int column = 0; column < 3; ++column) world_from_camera[column] = turnAxes(world_from_camera[column]);
  return world_from_camera;
}

std::optional<double> number(const tinygltf::Value& object, const char* key) {
  if (!object.Has(key) || !object.Get(key).IsNumber()) return std::nullopt;
  return object.Get(key).GetNumberAsDouble();
}

// All finite.
template <int N>
std::optional<glm::vec<N, double>> numbers(const tinygltf::Value& object, const char* key) {
  if (!object.Has(key) || !object.Get(key).IsArray() || object.Get(key).ArrayLen() != N) return std::nullopt;
  glm::vec<N, double> values;
  for (int i = 0; i < N; ++i) {
    const tinygltf::Value& value = object.Get(key).Get(i);
    if (!value.IsNumber() || !std::isfinite(value.GetNumberAsDouble())) return std::nullopt;
    values[i] = value.GetNumberAsDouble();
  }
  return values;
}

// Image size and intrinsics as intrinsicsOf() has them; false when anything is missing or out of range.
bool readIntrinsics(const tinygltf::Value& ours, Camera& camera) {
  const auto width = number(ours, "width"), height = number(ours, "height");
  const auto fx = number(ours, "fx"), fy = number(ours, "fy"), cx = number(ours, "cx"), cy = number(ours, "cy");
  if (!width || !height || !fx || !fy || !cx || !cy) return false;
  if (!(*width >= 1 && *width <= kMaxSide && *height >= 1 && *height <= kMaxSide && *fx > 0 && *fy > 0)) return false;
  camera.size = {*width, *height};
  camera.focal = {*fx, *fy};
  camera.center = {*cx, *cy};
  return true;
}

// What addCameras() wrote.
bool readExtras(const tinygltf::Value& extras, Camera& camera) {
  if (!extras.Has(kExtrasKey)) return false;
  const tinygltf::Value& ours = extras.Get(kExtrasKey);
  if (!readIntrinsics(ours, camera)) return false;
  camera.test = ours.Has("split") && ours.Get("split").IsString() && ours.Get("split").Get<std::string>() == "test";
  return true;
}

nlohmann::ordered_json poseOf(const Camera& camera) {
  const glm::dvec3 position = turnAxes(camera.position());
  const glm::dvec4 q = quaternionFromMatrix(turnWorldAxes(turnCameraAxes(glm::transpose(camera.rotation))));
  return {{"translation", {position.x, position.y, position.z}}, {"rotation", {q.y, q.z, q.w, q.x}}};
}

nlohmann::ordered_json intrinsicsOf(const Camera& camera) {
  return {{"width", camera.size.x}, {"height", camera.size.y}, {"fx", camera.focal.x},
          {"fy", camera.focal.y},   {"cx", camera.center.x},   {"cy", camera.center.y}};
}

}  // namespace

void addCameras(nlohmann::ordered_json& root, std::span<const Camera> cameras) {
  for (const Camera& camera : cameras) {
    root["cameras"].push_back({{"type", "perspective"},
                               {"perspective",
                                {{"aspectRatio", (camera.size.x / camera.focal.x) / (camera.size.y / camera.focal.y)},
                                 {"yfov", 2.0 * std::atan(0.5 * camera.size.y / camera.focal.y)},
                                 {"zfar", kZFar},
                                 {"znear", kZNear}}}});
    nlohmann::ordered_json node = {{"name", camera.name}, {"camera", root["cameras"].size() - 1}};
    node.update(poseOf(camera));
    node["extras"][kExtrasKey] = intrinsicsOf(camera);
    node["extras"][kExtrasKey]["split"] = camera.test ? "test" : "train";
    root["scenes"][0]["nodes"].push_back(root["nodes"].size());
    root["nodes"].push_back(std::move(node));
  }
}

nlohmann::ordered_json listViews(std::span<const Camera> views) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Camera& camera : views) {
    nlohmann::ordered_json view = {{"name", camera.name}};
    view.update(poseOf(camera));
    view.update(intrinsicsOf(camera));
    list.push_back(std::move(view));
  }
  return list;
}

std::vector<Camera> readViews(const tinygltf::Value& list, const RigidScale& world_from_scene, std::size_t& skipped) {
  std::vector<Camera> views;
  skipped = list.IsArray() ? 0 : 1;
  const int count = list.IsArray() ? static_cast<int>(list.ArrayLen()) : 0;
  for (int i = 0; i < count; ++i) {
    const tinygltf::Value& view = list.Get(i);
    Camera camera;
    auto t = numbers<3>(view, "translation");
    const auto q = numbers<4>(view, "rotation");
    if (!t || !q || !readIntrinsics(view, camera) || !(glm::length(*q) > 0)) {
      ++skipped;
      continue;
    }
    if (view.Has("name") && view.Get("name").IsString()) camera.name = view.Get("name").Get<std::string>();
    glm::dmat3 rotation = matrixFromQuaternion({q->w, q->x, q->y, q->z});
    if (!world_from_scene.identity) {
      rotation = world_from_scene.rotation * rotation;
      t = world_from_scene.scale * (world_from_scene.rotation * *t) + world_from_scene.translation;
    }
    camera.rotation = glm::transpose(turnCameraAxes(turnWorldAxes(rotation)));
    camera.translation = -camera.rotation * turnAxes(*t);
    // What is written of them are floats, too.
    const glm::vec3 floats = glm::abs(glm::vec3(camera.translation)) + glm::abs(glm::vec3(camera.position()));
    if (!std::isfinite(floats.x + floats.y + floats.z)) {
      ++skipped;
      continue;
    }
    views.push_back(std::move(camera));
  }
  return views;
}

std::optional<Camera> readCamera(GltfDocument& document, const PlacedNode& placed) {
  const tinygltf::Node& node = document.model.nodes[placed.node];
  const tinygltf::Camera& gltf = document.model.cameras[node.camera];
  const std::string pointer = "/cameras/" + std::to_string(node.camera);
  const double yfov = gltf.perspective.yfov;
  if (gltf.type != "perspective" || !(yfov > 0.0 && yfov < M_PI)) {
    document.warn(pointer, "skipped (expected a perspective camera with 0 < yfov < pi)");
    return std::nullopt;
  }
  std::string wrong;
  const std::optional<RigidScale> pose = decompose(placed.world_from_node, wrong);
  if (!pose) {
    document.warn("/nodes/" + std::to_string(placed.node), "camera skipped: its pose is not rigid");
    return std::nullopt;
  }
  Camera camera;
  camera.name = node.name;
  const glm::dmat3 world_from_camera = turnCameraAxes(turnWorldAxes(pose->rotation));
  camera.rotation = glm::transpose(world_from_camera);
  camera.translation = -camera.rotation * turnAxes(pose->translation);
  if (!readExtras(node.extras, camera)) {
    const double aspect = gltf.perspective.aspectRatio;
    camera.size.y = kDefaultRows;
    camera.size.x = static_cast<int>(
        std::min(std::max(std::lround(kDefaultRows * (aspect > 0.0 ? aspect : kDefaultAspect)), 1L), long{kMaxSide}));
    camera.focal = glm::dvec2(0.5 * camera.size.y / std::tan(0.5 * yfov));
    camera.center = 0.5 * glm::dvec2(camera.size);
  }
  return camera;
}

}  // namespace tg
