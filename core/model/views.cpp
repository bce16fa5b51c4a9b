// SPDX-License-Identifier: Apache-2.0
// Which of a scene's views have what of it in their pictures, and a choice of a few that stand for all.
#include "core/model/views.h"

#include <algorithm>
#include <cmath>

#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr std::size_t kPointsLookedAt = 4096;
constexpr double kSightings = 6;  // docs/lab/quality.md "Wide scenes"

}  // namespace

std::vector<Sighting> sightings(std::span<const glm::vec3> points, std::span<const Camera> views) {
  if (points.empty()) return {};
  const std::size_t step = std::max<std::size_t>(points.size() / kPointsLookedAt, 1);
  std::vector<Sighting> found((points.size() - 1) / step + 1);
  parallelFor(static_cast<std::int64_t>(found.size()), 64, [&](std::int64_t i) {
    Sighting& sighting = found[static_cast<std::size_t>(i)];
    for (const Camera& view : views) {
      const glm::dvec3 at = cameraFromWorld(view, points[static_cast<std::size_t>(i) * step]);
      if (!(at.z > 0)) continue;
      const glm::dvec2 pixel = project(view, at);
      if (!(pixel.x >= 0 && pixel.x < view.size.x && pixel.y >= 0 && pixel.y < view.size.y)) continue;
      if (sighting.views == 0 || at.z < sighting.nearest) sighting.nearest = at.z;
      ++sighting.views;
    }
  });
  return found;
}

std::vector<Camera> evenly(std::span<const Camera> views, std::size_t most) {
  std::vector<Camera> some;
  const std::size_t count = std::min(views.size(), most);
  for (std::size_t k = 0; k < count; ++k) some.push_back(views[k * views.size() / count]);
  return some;
}

std::size_t viewsForAll(std::span<const glm::vec3> points, std::span<const Camera> views, std::size_t least) {
  if (views.size() <= least) return least;
  std::vector<std::size_t> seen;
  for (const Sighting& sighting : sightings(points, views)) {
    if (sighting.views > 0) seen.push_back(sighting.views);
  }
  if (seen.empty()) return least;
  const auto tenth = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() / 10);
  std::nth_element(seen.begin(), tenth, seen.end());
  const double share = static_cast<double>(*tenth) / static_cast<double>(views.size());
  const auto enough = static_cast<std::size_t>(kSightings / share);
  return std::clamp(enough, least, views.size());
}

}  // namespace tg
