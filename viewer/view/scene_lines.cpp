// SPDX-License-Identifier: Apache-2.0
// World lines and their way into the image.
#include "viewer/view/scene_lines.h"

#include <algorithm>
#include <array>

#include "viewer/view/inspection.h"

namespace tg {
namespace {

constexpr double kNearest = 1e-3;  // [scene units of depth over the far end's] where lines are cut before the camera
constexpr double kFrustumSize = 0.08;    // [scene radii] depth of a key's frustum
constexpr int kStepsPerSegment = 24;     // of the path's curve, between two keys
constexpr std::size_t kMaxSteps = 2000;  // of the whole curve
const glm::vec3 kPathColor(0.95f, 0.65f, 0.20f);
const glm::vec3 kKeyColor(0.45f, 0.72f, 0.90f);
constexpr double kOutlineSigmas = 3;  // as far as its texture
const glm::vec3 kOutlineColor(1.0f, 0.45f, 0.85f);
const glm::vec3 kPickedColor(1.0f, 0.85f, 0.2f);
const glm::vec3 kCropColor(0.55f, 0.85f, 0.55f);
const glm::vec3 kChosenKeyColor(1.0f, 1.0f, 1.0f);

void appendFrustum(std::vector<SceneLine>& lines, const PathKey& key, double aspect, double depth, glm::vec3 color) {
  const Camera camera = toCamera(key, aspect, 1000, std::max(static_cast<int>(1000 / aspect), 1));
  const glm::dmat3 world_from_camera = glm::mat3_cast(key.world_from_camera);
  std::array<glm::dvec3, 4> corners;
  for (int i = 0; i < 4; ++i) {
    const glm::dvec2 corner(i == 1 || i == 2 ? camera.size.x : 0, i >= 2 ? camera.size.y : 0);
    corners[static_cast<std::size_t>(i)] = key.position + world_from_camera * (depth * ray(camera, corner));
  }
  for (std::size_t i = 0; i < 4; ++i) {
    lines.push_back({key.position, corners[i], color, 1});
    lines.push_back({corners[i], corners[(i + 1) % 4], color, 1});
  }
}

void appendPath(std::vector<SceneLine>& lines, const ViewerState& state) {
  const CameraPath& path = state.path.path;
  const std::size_t segments = path.keys.size() - (path.closing > 0 ? 0 : 1);
  const std::size_t steps = std::min(segments * kStepsPerSegment, kMaxSteps);
  for (std::size_t i = 0; i < steps; ++i) {
    const double from = duration(path) * static_cast<double>(i) / static_cast<double>(steps);
    const double to = duration(path) * static_cast<double>(i + 1) / static_cast<double>(steps);
    lines.push_back({at(path, from).position, at(path, to).position, kPathColor, 2});
  }
  for (std::size_t i = 0; i < path.keys.size(); ++i) {
    const bool chosen = static_cast<int>(i) == state.path.key;
    appendFrustum(lines, path.keys[i], path.aspect, kFrustumSize * state.scene.bounds.radius,
                  chosen ? kChosenKeyColor : kKeyColor);
  }
}

// Its texture's square, its axes to one sigma - red, green, blue as x, y, z - and its outline.
void appendGaussian(std::vector<SceneLine>& lines, const ViewerState& state, std::uint32_t index) {
  const GaussianModel& model = *state.scene.model;
  const double scale = state.display.settings.splat_scale;
  const std::array<glm::dvec3, 4> corners = textureSquare(model, index, scale);
  for (std::size_t i = 0; i < 4; ++i) lines.push_back({corners[i], corners[(i + 1) % 4], kPickedColor, 2});
  const glm::vec4 q = model.rotation[index];
  const glm::dmat3 world_from_local = glm::mat3_cast(glm::normalize(glm::dquat(q.x, q.y, q.z, q.w)));
  const GaussianFacts facts = factsOf(model, index);
  for (int axis = 0; axis < 3; ++axis) {
    glm::vec3 color(0.35f);
    color[axis] = 1.0f;
    lines.push_back({facts.mean, facts.mean + scale * facts.sigma[axis] * world_from_local[axis], color, 2});
  }
  const std::vector<glm::dvec3> outline = outlineOf(model, index, kOutlineSigmas * scale, state.camera.pose.position);
  for (std::size_t i = 0; i < outline.size(); ++i) {
    lines.push_back({outline[i], outline[(i + 1) % outline.size()], kOutlineColor, 2});
  }
}

}  // namespace

std::optional<std::pair<glm::dvec2, glm::dvec2>> projected(const Camera& camera, glm::dvec3 a, glm::dvec3 b) {
  glm::dvec3 p = cameraFromWorld(camera, a), q = cameraFromWorld(camera, b);
  const double nearest = kNearest * std::max({p.z, q.z, 0.0});
  if (!(nearest > 0) || (p.z < nearest && q.z < nearest)) return std::nullopt;
  const auto cut = [nearest](const glm::dvec3& behind, const glm::dvec3& before) {
    return behind + (before - behind) * ((nearest - behind.z) / (before.z - behind.z));
  };
  if (p.z < nearest) p = cut(p, q);
  if (q.z < nearest) q = cut(q, p);
  return std::pair{project(camera, p), project(camera, q)};
}

void appendBox(std::vector<SceneLine>& lines, glm::dvec3 low, glm::dvec3 high, glm::vec3 color) {
  const auto corner = [&](int i) {
    return glm::dvec3(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
  };
  for (int i = 0; i < 8; ++i) {
    for (int axis = 1; axis <= 4; axis *= 2) {
      if (!(i & axis)) lines.push_back({corner(i), corner(i | axis), color, 1.5f});
    }
  }
}

std::vector<SceneLine> sceneLines(const ViewerState& state) {
  std::vector<SceneLine> lines;
  // While it plays, its own frusta would be in the way.
  if (state.path.drawn && !state.path.playing && !state.record.wanted && !state.path.path.keys.empty()) {
    appendPath(lines, state);
  }
  if (state.display.crop) appendBox(lines, state.display.box.min, state.display.box.max, kCropColor);
  if (const auto picked = pickedGaussian(state); picked && state.scene.model) appendGaussian(lines, state, *picked);
  return lines;
}

}  // namespace tg
