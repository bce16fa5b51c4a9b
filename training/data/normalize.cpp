// SPDX-License-Identifier: Apache-2.0
// Whether a scene's size and place suit training, and a scene that is moved and scaled to one that does.
#include "training/data/normalize.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "core/model/float_steps.h"
#include "core/model/views.h"
#include "core/system/error.h"
#include "core/system/median.h"
#include "core/system/numbers.h"
#include "shared/limits.h"

namespace tg {
namespace {

// Of their distance from the origin: cameras that are this near each other are at one place, but for the rounding of
// what wrote them. Where points say how far away the scene is, doubles may be nearer, down to this part of that.
constexpr double kTogether = 1e-7;
constexpr double kTogetherOfDepth = 1e-5;
constexpr double kFarthestCamera = 1e100;  // [world units] products of three stay far inside doubles
constexpr std::size_t kLookedAtPoints = 4096, kLookedAtViews = 64;

double largestOf(const glm::dvec3& point) {
  return std::max({std::abs(point.x), std::abs(point.y), std::abs(point.z)});
}

// What some of the views have of the scene before them.
struct Look {
  std::vector<double> depths;       // [world units] of points in their pictures
  std::vector<double> pixels;       // [world units] of a pixel's width there
  std::vector<double> coordinates;  // [world units] the largest of each place
};

std::size_t stepOf(const PointCloud& points) {
  return std::max<std::size_t>(points.position.size() / kLookedAtPoints, 1);
}

Look lookAtPoints(const PointCloud& points, std::span<const Camera> views) {
  Look look;
  for (std::size_t i = 0; i < points.position.size(); i += stepOf(points)) {
    const glm::dvec3 point(points.position[i]);
    look.coordinates.push_back(largestOf(point));
    for (const Camera& view : views) {
      const glm::dvec3 at = cameraFromWorld(view, point);
      if (!(at.z > 0)) continue;
      const glm::dvec2 pixel = project(view, at);
      if (!(pixel.x >= 0 && pixel.x < view.size.x && pixel.y >= 0 && pixel.y < view.size.y)) continue;
      look.depths.push_back(at.z);
      look.pixels.push_back(at.z / view.focal.x);
    }
  }
  return look;
}

Look lookAlongAxes(std::span<const Camera> views) {
  Look look;
  if (!spanOf(views)) return look;  // what one place looks at is at no distance in particular
  const glm::dvec3 target = lookedAt(views);
  for (const Camera& view : views) {
    look.depths.push_back(glm::length(view.position() - target));
    look.pixels.push_back(look.depths.back() / view.focal.x);
    look.coordinates.push_back(largestOf(view.position()));
  }
  return look;
}

// How far the median of some of the points lies before the nearest of some of the cameras, of those that have it within
// 60 degrees of their axis; none: 0. [world units]
double nearestDepth(const PointCloud& points, std::span<const Camera> cameras) {
  std::vector<double> depths;
  const std::vector<Camera> some = evenly(cameras, kLookedAtViews);
  for (std::size_t i = 0; i < points.position.size(); i += stepOf(points)) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Camera& camera : some) {
      const glm::dvec3 at = cameraFromWorld(camera, glm::dvec3(points.position[i]));
      if (at.z > 0.5 * glm::length(at)) nearest = std::min(nearest, at.z);
    }
    if (std::isfinite(nearest)) depths.push_back(nearest);
  }
  return depths.empty() ? 0 : medianOf(std::move(depths));
}

}  // namespace

std::optional<double> spanOf(std::span<const Camera> views) {
  glm::dvec3 mean(0.0);
  for (const Camera& view : views) mean += view.position() / static_cast<double>(views.size());
  double radius = 0, farthest = 0;
  for (const Camera& view : views) {
    radius = std::max(radius, glm::length(view.position() - mean));
    farthest = std::max(farthest, glm::length(view.position()));
  }
  if (!(radius > kTogether * farthest)) return std::nullopt;
  return 1.1 * radius;
}

glm::dvec3 lookedAt(std::span<const Camera> views) {
  // sum (I - d d^T) (x - o) = 0. The small multiple of the identity keeps parallel axes solvable.
  glm::dvec3 mean(0.0);
  for (const Camera& view : views) mean += view.position() / static_cast<double>(views.size());
  constexpr double kPull = 1e-3;
  glm::dmat3 matrix(kPull);
  glm::dvec3 right = kPull * mean;
  for (const Camera& view : views) {
    const glm::dvec3 axis = glm::transpose(view.rotation)[2];
    const glm::dmat3 projector = glm::dmat3(1.0) - glm::outerProduct(axis, axis);
    matrix += projector;
    right += projector * view.position();
  }
  return glm::inverse(matrix) * right;
}

glm::dvec3 middleOf(const std::vector<DatasetIndex::Entry>& entries) {
  glm::dvec3 middle(0.0);
  if (entries.empty()) return middle;
  for (const DatasetIndex::Entry& entry : entries) {
    const glm::dvec3 position = entry.camera.position();
    if (largestOf(position) <= kFarthestCamera) continue;
    throw Error(
        ErrorKind::badData, entry.image.string(),
        "camera position out of range" + expectedFound("-1e100 to 1e100", formatted("%g", largestOf(position))));
  }
  std::vector<double> values(entries.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < entries.size(); ++i) values[i] = entries[i].camera.position()[axis];
    middle[axis] = medianOf(values);
  }
  return middle;
}

Normalization normalize(DatasetIndex& index, std::vector<std::string>& notes) {
  const glm::dvec3& origin = index.origin;
  std::vector<Camera> cameras;
  std::vector<double> distances;
  double farthest = 0;
  for (const DatasetIndex::Entry& entry : index.entries) {
    cameras.push_back(entry.camera);
    farthest = std::max(farthest, glm::length(entry.camera.position()));
    cameras.back().translation += cameras.back().rotation * origin;
    distances.push_back(glm::length(cameras.back().position()));
  }
  const double apart = distances.empty() ? 0 : medianOf(std::move(distances));
  const double depth = nearestDepth(index.points, cameras);
  const double by_points = depth > 0 ? kNormalDepth / depth : 0;
  double scale = depth > 0 ? kNormalExtent / depth : 1;
  if (apart > (depth > 0 ? kTogetherOfDepth * depth : kTogether * farthest))
    scale = std::max(kNormalExtent / (1.1 * apart), by_points);
  if (!std::isnormal(scale) || !std::isnormal(1 / scale)) {
    throw Error(ErrorKind::badData,
                "cameras and points lie too near each other or too far apart to be normalized (they would be " +
                    formatted("%g", scale) + " times as large)");
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) index.entries[i].camera.translation = scale * cameras[i].translation;
  notes.push_back("normalized: " + formatted("%.6g", scale) + " times as large, about " + formatted("%.6g", origin.x) +
                  "," + formatted("%.6g", origin.y) + "," + formatted("%.6g", origin.z) +
                  " (tgconvert brings a model back with --scale " + numberText(1 / scale) + " --translate " +
                  numberText(origin.x) + "," + numberText(origin.y) + "," + numberText(origin.z) + ")");
  return {scale, origin};
}

std::vector<std::string> notesOnPlace(const Dataset& dataset, const std::string& remedy) {
  const std::vector<Camera> views = evenly(dataset.views, kLookedAtViews);
  const bool has_points = !dataset.points.position.empty();
  const Look look = has_points ? lookAtPoints(dataset.points, views) : lookAlongAxes(views);
  std::vector<std::string> notes;
  if (look.depths.empty()) return notes;
  const std::string add = remedy.empty() || dataset.normalized || dataset.block ? "" : " (add " + remedy + ")";
  if (!(medianOf(look.depths) > kNear)) {
    notes.push_back(
        (has_points ? "most points lie nearer to the cameras than " : "what the cameras look at lies nearer than ") +
        formatted("%.2g", static_cast<double>(kNear)) + ", where nothing is drawn" + add);
  }
  const std::string coarse = coarseFloats(medianOf(look.coordinates), medianOf(look.pixels));
  if (!coarse.empty()) notes.push_back((has_points ? "points " : "cameras ") + coarse + add);
  return notes;
}

}  // namespace tg
