// SPDX-License-Identifier: Apache-2.0
// Handles of a constant size on screen.
#include "viewer/view/gizmo.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "converter/gltf/axes.h"
#include "core/system/assert.h"

namespace tg {
namespace {

constexpr double kAxisPixels = 80;  // [Gizmo::unit] of an axis that lies in the picture's plane
constexpr double kReach = 8;        // [Gizmo::unit] around a handle
constexpr double kMiddle = 9;       // [Gizmo::unit] half the square in the middle
constexpr double kViewRing = 1.2;   // [axes] its radius
constexpr int kRingSteps = 64;      // of a ring's line
constexpr double kEdgeOn = 0.25;    // a ring's plane that is steeper to the view is turned along its line
constexpr double kLeastScale = 0.01, kMostScale = 100;
constexpr double kDegree = 3.14159265358979323846 / 180.0;  // [rad]
constexpr double kNearestDepth = 1e-9;                      // [world units]

glm::dvec2 pixelOf(const Camera& camera, glm::dvec3 world) { return project(camera, cameraFromWorld(camera, world)); }
double depthOf(const Camera& camera, glm::dvec3 world) { return cameraFromWorld(camera, world).z; }
glm::dvec3 worldRay(const Camera& camera, glm::dvec2 at) { return glm::transpose(camera.rotation) * ray(camera, at); }
glm::dvec3 viewAxis(const Camera& camera) { return glm::transpose(camera.rotation)[2]; }

glm::dvec3 axisOf(Handle handle, const Camera& camera) {
  if (handle == Handle::view) return viewAxis(camera);
  glm::dvec3 axis(0.0);
  axis[static_cast<int>(handle) - static_cast<int>(Handle::x)] = 1;
  return axis;
}

// Two directions across an axis.
std::array<glm::dvec3, 2> across(glm::dvec3 axis) {
  const glm::dvec3 helper = std::abs(axis.x) < 0.8 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 u = glm::normalize(glm::cross(axis, helper));
  return {u, glm::cross(axis, u)};
}

GizmoLine ring(const Gizmo& gizmo, const Camera& camera, Handle handle, double radius) {
  GizmoLine line{{}, handle};
  const auto [u, v] = across(axisOf(handle, camera));
  for (int i = 0; i <= kRingSteps; ++i) {
    const double angle = 360 * kDegree * i / kRingSteps;
    const glm::dvec3 p = gizmo.origin + radius * gizmo.size * (std::cos(angle) * u + std::sin(angle) * v);
    if (depthOf(camera, p) > kNearestDepth) line.points.push_back(pixelOf(camera, p));
  }
  return line;
}

GizmoLine square(const Gizmo& gizmo, const Camera& camera) {
  const glm::dvec2 middle = pixelOf(camera, gizmo.origin);
  GizmoLine line{{}, Handle::view};
  for (const glm::dvec2 corner : {glm::dvec2(-1, -1), {1, -1}, {1, 1}, {-1, 1}, {-1, -1}}) {
    line.points.push_back(middle + kMiddle * gizmo.unit * corner);
  }
  return line;
}

double distanceTo(const GizmoLine& line, glm::dvec2 at) {
  double nearest = 1e30;
  for (std::size_t i = 1; i < line.points.size(); ++i) {
    const glm::dvec2 a = line.points[i - 1], way = line.points[i] - a;
    const double squared = glm::dot(way, way);
    const double along = squared > 0 ? std::clamp(glm::dot(at - a, way) / squared, 0.0, 1.0) : 0.0;
    nearest = std::min(nearest, glm::distance(at, a + along * way));
  }
  return nearest;
}

// How far along the axis from the origin the ray of a place of the image passes nearest to it; none where the axis
// points at the viewer.
std::optional<double> alongAxis(const Gizmo& gizmo, glm::dvec3 axis, const Camera& camera, glm::dvec2 at) {
  const glm::dvec3 d = glm::normalize(worldRay(camera, at)), between = gizmo.origin - camera.position();
  const double cosine = glm::dot(axis, d), sine2 = 1 - cosine * cosine;
  if (sine2 < 1e-3) return std::nullopt;
  return (cosine * glm::dot(between, d) - glm::dot(between, axis)) / sine2;
}

double angleAbout(const Gizmo& gizmo, glm::dvec3 axis, const Camera& camera, glm::dvec2 from, glm::dvec2 to) {
  const glm::dvec3 eye = camera.position(), toward = glm::normalize(gizmo.origin - eye);
  const auto [u, v] = across(axis);
  if (std::abs(glm::dot(toward, axis)) > kEdgeOn) {
    const auto angle = [&](glm::dvec2 at) -> std::optional<double> {
      const glm::dvec3 d = worldRay(camera, at);
      const double slope = glm::dot(d, axis);
      const double t = glm::dot(gizmo.origin - eye, axis) / slope;
      if (std::abs(slope) < 1e-9 || t <= 0) return std::nullopt;
      const glm::dvec3 p = eye + t * d - gizmo.origin;
      return std::atan2(glm::dot(p, v), glm::dot(p, u));
    };
    const auto a = angle(from), b = angle(to);
    return a && b ? std::remainder(*b - *a, 360 * kDegree) : 0.0;
  }
  // Along the line that the ring is seen as.
  const glm::dvec3 tangent = glm::normalize(glm::cross(axis, -toward));
  const glm::dvec2 middle = pixelOf(camera, gizmo.origin);
  const glm::dvec2 way = pixelOf(camera, gizmo.origin + gizmo.size * tangent) - middle;
  return glm::dot(to - from, way) / std::max(glm::dot(way, way), 1e-9);
}

}  // namespace

std::optional<Gizmo> gizmoAt(GizmoKind kind, glm::dvec3 origin, const Camera& camera, double unit) {
  const double depth = depthOf(camera, origin);
  if (!(depth > kNearestDepth)) return std::nullopt;
  return Gizmo{kind, origin, kAxisPixels * unit * depth / camera.focal.y, unit};
}

std::vector<GizmoLine> gizmoLines(const Gizmo& gizmo, const Camera& camera) {
  std::vector<GizmoLine> lines;
  switch (gizmo.kind) {
    case GizmoKind::move:
      for (const Handle handle : {Handle::x, Handle::y, Handle::z}) {
        const glm::dvec3 end = gizmo.origin + gizmo.size * axisOf(handle, camera);
        if (depthOf(camera, end) <= kNearestDepth) continue;
        lines.push_back({{pixelOf(camera, gizmo.origin), pixelOf(camera, end)}, handle, true});
      }
      lines.push_back(square(gizmo, camera));
      break;
    case GizmoKind::turn:
      for (const Handle handle : {Handle::x, Handle::y, Handle::z}) {
        lines.push_back(ring(gizmo, camera, handle, 1));
      }
      lines.push_back(ring(gizmo, camera, Handle::view, kViewRing));
      break;
    case GizmoKind::scale:
      lines.push_back(ring(gizmo, camera, Handle::view, 1));
      lines.push_back(square(gizmo, camera));
      break;
  }
  return lines;
}

Handle handleAt(const Gizmo& gizmo, const Camera& camera, glm::dvec2 at) {
  Handle found = Handle::none;
  double nearest = kReach * gizmo.unit;
  // The square in the middle lies over the axes that begin there.
  const glm::dvec2 from_middle = glm::abs(at - pixelOf(camera, gizmo.origin));
  const double half = kMiddle * gizmo.unit;
  if (gizmo.kind == GizmoKind::move && from_middle.x <= half && from_middle.y <= half) return Handle::view;
  for (const GizmoLine& line : gizmoLines(gizmo, camera)) {
    // Nothing can be dragged along an axis that points at the viewer.
    if (line.arrow && !alongAxis(gizmo, axisOf(line.handle, camera), camera, at)) continue;
    const double distance = distanceTo(line, at);
    if (distance > nearest) continue;
    nearest = distance;
    found = line.handle;
  }
  return found;
}

Similarity dragged(const Gizmo& gizmo, Handle handle, const Camera& camera, glm::dvec2 from, glm::dvec2 to) {
  TG_ASSERT(handle != Handle::none, "a handle is dragged");
  Similarity result;
  const glm::dvec3 axis = axisOf(handle, camera);
  const glm::dvec2 middle = pixelOf(camera, gizmo.origin);
  if (gizmo.kind == GizmoKind::scale) {
    const double before = glm::distance(from, middle), after = glm::distance(to, middle);
    // From the middle there is no ratio: right and up make it larger.
    const double factor = before > 2 * kMiddle * gizmo.unit
                              ? after / before
                              : std::exp((to.x - from.x - to.y + from.y) / (kAxisPixels * gizmo.unit));
    result.scale = std::clamp(factor, kLeastScale, kMostScale);
    return about(result, gizmo.origin);
  }
  if (gizmo.kind == GizmoKind::turn) {
    const double half = 0.5 * angleAbout(gizmo, axis, camera, from, to);
    result.rotation = matrixFromQuaternion(glm::dvec4(std::cos(half), std::sin(half) * axis));
    return about(result, gizmo.origin);
  }
  if (handle == Handle::view) {
    result.translation = depthOf(camera, gizmo.origin) * (worldRay(camera, to) - worldRay(camera, from));
    return result;
  }
  const auto before = alongAxis(gizmo, axis, camera, from), after = alongAxis(gizmo, axis, camera, to);
  if (before && after) result.translation = (*after - *before) * axis;
  return result;
}

std::string dragText(const Gizmo& gizmo, Handle handle, const Similarity& similarity) {
  char text[96];
  if (gizmo.kind == GizmoKind::scale) {
    std::snprintf(text, sizeof text, "x %.3f", similarity.scale);
  } else if (gizmo.kind == GizmoKind::turn) {
    const glm::dmat3& r = similarity.rotation;
    const double cosine = std::clamp((r[0][0] + r[1][1] + r[2][2] - 1) / 2, -1.0, 1.0);
    std::snprintf(text, sizeof text, "%.1f\xc2\xb0", std::acos(cosine) / kDegree);
  } else if (handle == Handle::view) {
    const glm::dvec3 t = similarity.translation;
    std::snprintf(text, sizeof text, "%+.4g, %+.4g, %+.4g", t.x, t.y, t.z);
  } else {
    const int axis = static_cast<int>(handle) - static_cast<int>(Handle::x);
    std::snprintf(text, sizeof text, "%c %+.4g", "xyz"[axis], similarity.translation[axis]);
  }
  return text;
}

}  // namespace tg
