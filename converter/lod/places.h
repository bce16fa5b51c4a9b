// SPDX-License-Identifier: Apache-2.0
// Whether Gaussians are where lod-meta.json says.
#pragma once
#include <cstdint>
#include <vector>

#include "converter/lod/lod_scene.h"

namespace tg {

// Of a scene that outlives it.
class LodPlaces {
 public:
  explicit LodPlaces(const LodScene& scene);
  // Throws Error(badData) where means of what readLodFile() gave for a file are outside the bounds of its leaves, by
  // more than a SOG moves them.
  void require(std::uint32_t file, const GaussianModel& model) const;

 private:
  struct Place {
    std::uint32_t leaf;
    LodRange range;
  };
  const LodScene& scene_;
  std::vector<std::vector<Place>> places_;  // [files]
  Box whole_;                               // around all leaves
};

}  // namespace tg
