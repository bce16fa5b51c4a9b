// SPDX-License-Identifier: Apache-2.0
// Reads 3D Tiles of one tile with content: tileset.json and the glTF that it names.
#pragma once
#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <span>
#include <string>

#include "converter/formats/read_options.h"
#include "core/bundle/bundle.h"

namespace tg {

struct TileContent {
  std::string name;  // of a file beside the tileset or in a folder there, never outside
  // In glTF's axes, which are a quarter turn from a tile's; the identity where the tile lies on the globe.
  glm::dmat4 scene_from_content{1.0};
  bool on_globe = false;
};

// `path` starts the messages. Throws Error(badData), also for a tileset of another version than 1.0 and 1.1, with other
// extensions required than 3DTILES_content_gltf, of more or fewer contents than one, of implicit tiles, and for content
// that is no file beside it.
TileContent parseTileset(std::span<const std::uint8_t> text, const std::string& path);

// The file of its content. Throws as parseTileset().
std::filesystem::path contentOfTileset(const std::filesystem::path& path);

// Throws as parseTileset() and readGltf().
Bundle readTiles(const std::filesystem::path& path, const ReadOptions& options = {});

}  // namespace tg
