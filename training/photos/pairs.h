// SPDX-License-Identifier: Apache-2.0
// Which photographs are held against each other. All pairs grow with the square; no vocabulary of features is needed,
// nor downloaded, for the others.
#pragma once
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "core/system/names.h"
#include "training/photos/photograph.h"

namespace tg {

enum class Matching { automatic, exhaustive, sequential, spatial };
constexpr auto namesOf(Matching) { return enumNames("auto", "exhaustive", "sequential", "spatial"); }

constexpr std::size_t kMostExhaustive = 200;  // photographs of which all pairs are matched

// What `automatic` stands for: sequential for a film; all pairs of up to kMostExhaustive photographs; above, spatial
// where all say where they were taken, else sequential.
Matching chosenMatching(Matching asked, bool film, const std::vector<std::optional<Place>>& places);

using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;  // first < second, sorted, none twice

Pairs allPairs(std::size_t count);
// Each with the ten that follow and the 16th, 32nd, ... 512th; and every tenth with every other tenth, which closes
// loops.
Pairs sequentialPairs(std::size_t count);
// Each with its 30 nearest on the ground, and with the five that follow.
Pairs spatialPairs(const std::vector<Place>& places);

}  // namespace tg
