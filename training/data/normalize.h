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
constexpr double kNormalDepth = 1;   // [world units] of the nearest camera that sees it, of the median point at least

// 1.1 * the largest distance of a view from their mean; none where all stand at one place. [world units]
std::optional<double> spanOf(std::span<const Camera> views);

// The point nearest to all optical axes in the least-squares sense, pulled a little to the views' mean. [world units]
glm::dvec3 lookedAt(std::span<const Camera> views);

// The median camera position, axis by axis: one far out does not move it. The entries' cameras have poses. Throws
// Error(badData) for a camera with a coordinate beyond 1e100.
glm::dvec3 middleOf(const std::vector<DatasetIndex::Entry>& entries);

// Cameras get index.origin in their middle and are scaled: 1.1 * their median distance from there becomes
// kNormalExtent, or more where the data set's own points would lie nearer than kNormalDepth. By all cameras that it
// lists, whatever is held out, missing or left out. Of cameras at one place the median point is then kNormalExtent
// away. Points, which are from index.origin, want the scale as well. The last of `notes` says how tgconvert brings a
// model back. Throws Error(badData) where the scale is no normal number.
Normalization normalize(DatasetIndex& index, std::vector<std::string>& notes);

// A line each for a scene most of which is so near to its cameras that it is not drawn, and for one so far out that
// floats are coarser than a tenth of a pixel there. Looks at some 4,096 points and 64 views. `remedy`: what is to be
// added against it, may be empty.
std::vector<std::string> notesOnPlace(const Dataset& dataset, const std::string& remedy);

}  // namespace tg
