// SPDX-License-Identifier: Apache-2.0
// Whether a scene's size and place suit training, and a scene that is moved and scaled to one that does.
#pragma once
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "training/data/dataset.h"

namespace tg {

constexpr double kNormalExtent = 4;  // [world units] about that of NeRF-synthetic scenes

// 1.1 * the largest distance of a view from their mean; none where all stand at one place. [world units]
std::optional<double> spanOf(std::span<const Camera> views);

// The point nearest to all optical axes in the least-squares sense, pulled a little to the views' mean. [world units]
glm::dvec3 lookedAt(std::span<const Camera> views);

// The median camera position, axis by axis: one far out does not move it. The entries' cameras have poses.
glm::dvec3 middleOf(const std::vector<DatasetIndex::Entry>& entries);

// Cameras and `points`, which are from index.origin, become as large as kNormalExtent says, with that origin in their
// middle: by all cameras that the data set lists, whatever is held out, missing or left out. Of cameras at one place
// the median point is then so far away. The last of `notes` says how tgconvert brings a model back.
void normalize(DatasetIndex& index, PointCloud& points, std::vector<std::string>& notes);

// A line each for a scene most of which is so near to its cameras that it is not drawn, and for one so far out that
// floats are coarser than a tenth of a pixel there. Looks at some 4,096 points and 64 views.
std::vector<std::string> notesOnPlace(const Dataset& dataset);

}  // namespace tg
