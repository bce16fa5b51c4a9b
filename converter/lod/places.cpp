// SPDX-License-Identifier: Apache-2.0
// Means against the bounds of their leaves.
#include "converter/lod/places.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "converter/lod/lod_names.h"
#include "converter/sog/sog.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr double kFloats = 1e-5;  // of a coordinate: what floats and numbers of seven digits leave open

}  // namespace

LodPlaces::LodPlaces(const LodScene& scene)
    : scene_(scene), places_(scene.files.size()), whole_(scene.leaves.front().bound) {
  for (std::uint32_t leaf = 0; leaf < scene.leaves.size(); ++leaf) {
    whole_ = around(whole_, scene.leaves[leaf].bound);
    const std::vector<LodRange>& levels = scene.leaves[leaf].levels;
    for (std::size_t level = 0; level < levels.size(); ++level) {
      const auto at = levels.begin() + static_cast<std::ptrdiff_t>(level);
      if (std::find(levels.begin(), at, *at) != at) continue;
      places_[levels[level].file].push_back({leaf, levels[level]});
    }
  }
}

void LodPlaces::require(std::uint32_t file, const GaussianModel& model) const {
  TG_ASSERT(model.size() >= scene_.file_counts[file], "a file holds what its ranges name");
  std::uint64_t named = 0, outside = 0;
  for (const Place& place : places_[file]) {
    const Box& bound = scene_.leaves[place.leaf].bound;
    glm::dvec3 low, high;
    for (int k = 0; k < 3; ++k) {
      const auto moved = [&](double x) {
        return sogStep(whole_.low[k], whole_.high[k], x) + kFloats * (1 + std::abs(x));
      };
      low[k] = bound.low[k] - moved(bound.low[k]);
      high[k] = bound.high[k] + moved(bound.high[k]);
    }
    named += place.range.count;
    for (std::uint32_t i = 0; i < place.range.count; ++i) {
      const glm::dvec3 mean = lod::reached(model.mean[place.range.first + i]);
      if (mean != glm::clamp(mean, low, high)) ++outside;
    }
  }
  if (outside == 0) return;
  throw Error(ErrorKind::badData, lod::besideMeta(scene_.path, scene_.files[file]),
              "Gaussians outside the bounds that lod-meta.json has for them" +
                  expectedFound("none of " + std::to_string(named), std::to_string(outside)));
}

}  // namespace tg
