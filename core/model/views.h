// SPDX-License-Identifier: Apache-2.0
// Which of a scene's views have what of it in their pictures, and a choice of a few that stand for all.
#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "core/model/camera.h"

namespace tg {

// A point as views have it in their pictures, hidden or not.
struct Sighting {
  double nearest = 0;     // [world units] along the view, of the nearest of them
  std::size_t views = 0;  // how many
};
// Of every k-th point, some 4,096.
std::vector<Sighting> sightings(std::span<const glm::vec3> points, std::span<const Camera> views);

// At most `most` views, every k-th.
std::vector<Camera> evenly(std::span<const Camera> views, std::size_t most);

// So many of the views, taken evenly, that nine in ten of the points (those in none apart) are in six of their pictures
// in the mean, at least `least`, for judging what a scene needs: of wide scenes a few views show a small part. Without
// points `least`.
std::size_t viewsForAll(std::span<const glm::vec3> points, std::span<const Camera> views, std::size_t least);

}  // namespace tg
