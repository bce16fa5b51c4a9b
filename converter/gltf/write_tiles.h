// SPDX-License-Identifier: Apache-2.0
// Writes a model as 3D Tiles for CesiumJS: tileset.json of one tile, whose GLB holds the splats as an SPZ.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string_view>

#include "converter/formats/spz.h"
#include "core/model/model.h"

namespace tg {

inline constexpr std::string_view kTilesetName = "tileset.json";

struct TilesReport {
  std::uint64_t bytes = 0;  // of both files
  SpzReport spz;
};

// `path` is tileset.json, or ends so; the tile's content.glb lies beside it, with what precedes tileset.json before its
// own name, too. Both come or none does; their folder is made if it is not there. `replace`: a content.glb that is
// there already; otherwise it is an error. Without textures, as formatSpz, whose version 3 this is: CesiumJS reads no
// other. Throws Error(badData) for a model without Gaussians and what formatSpz refuses, Error(cannotWrite).
TilesReport writeTiles(const std::filesystem::path& path, const GaussianModel& model, bool replace = true);

}  // namespace tg
