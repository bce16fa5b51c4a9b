// SPDX-License-Identifier: Apache-2.0
// Reads 3D Tiles of one tile with content (OGC 22-025r4).
#include "converter/gltf/read_tiles.h"

#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "converter/gltf/nodes.h"
#include "converter/gltf/read_gltf.h"
#include "converter/gltf/resolve.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxTilesetBytes = std::uint64_t{1} << 22;
constexpr double kFarthest = 1e5;  // [m] from the origin, where floats still tell centimetres apart

struct PlacedTile {
  JsonNode tile;
  glm::dmat4 transform;                            // to the tileset's axes
  std::optional<JsonNode> refused = std::nullopt;  // the first transform, its own or above, that splats cannot follow
  std::string wrong = {};                          // with it
};

constexpr std::string_view kContentGltf = "3DTILES_content_gltf";  // content may be glTF, in version 1.0, too

void requireKnown(const JsonNode& root) {
  const JsonNode asset = root.at("asset").object(), version = asset.at("version");
  const std::string name = version.string();
  if (name != "1.0" && name != "1.1") {
    version.fail("another version of 3D Tiles" + expectedFound("1.0 or 1.1", version.shown()));
  }
  if (!root.has("extensionsRequired")) return;
  const JsonNode required = root.at("extensionsRequired").array();
  for (std::size_t i = 0; i < required.size(); ++i) {
    const JsonNode extension = required.element(i);
    if (extension.string() == kContentGltf) continue;
    extension.fail("an extension that is not supported" + expectedFound(std::string(kContentGltf), extension.shown()));
  }
}

glm::dmat4 transformOf(const JsonNode& tile) {
  glm::dmat4 m(1.0);
  if (!tile.has("transform")) return m;
  const auto numbers = tile.numbers<16>("transform");
  for (int k = 0; k < 16; ++k) m[k / 4][k % 4] = numbers[static_cast<std::size_t>(k)];
  return m;
}

std::string nameOf(const JsonNode& content) {
  const std::string uri = content.object().string("uri");
  const std::optional<std::string> name = nameBeside(uri);
  if (!name) content.at("uri").fail("is no file beside the tileset (expected a relative name, found " +
                                    content.at("uri").shown() + ")");
  if (lowerExtension(*name) == ".json") {
    content.at("uri").fail("is another tileset (expected a .glb or .gltf, found " + content.at("uri").shown() + ")");
  }
  return *name;
}

glm::dmat4 sceneFromContent(const glm::dmat4& transform) {
  // A tile's z is up, where glTF has its y.
  const glm::dmat4 tile_from_gltf(glm::dvec4(1, 0, 0, 0), glm::dvec4(0, 0, 1, 0), glm::dvec4(0, -1, 0, 0),
                                  glm::dvec4(0, 0, 0, 1));
  return glm::transpose(tile_from_gltf) * transform * tile_from_gltf;
}

}  // namespace

TileContent parseTileset(std::span<const std::uint8_t> text, const std::string& path) {
  const nlohmann::json parsed = parseJson(text, path);
  const JsonNode root = JsonNode{parsed, path, "/"}.object();
  requireKnown(root);
  std::vector<PlacedTile> tiles = {{root.at("root").object(), glm::dmat4(1.0)}};
  std::optional<TileContent> found;
  std::size_t contents = 0;
  while (!tiles.empty()) {
    PlacedTile at = std::move(tiles.back());
    tiles.pop_back();
    at.transform = at.transform * transformOf(at.tile);
    if (!at.refused && !decompose(sceneFromContent(at.transform), at.wrong))
      at.refused.emplace(at.tile.at("transform"));
    if (at.tile.has("implicitTiling")) at.tile.fail("has implicit tiles, which are not read");
    std::vector<JsonNode> own;
    if (at.tile.has("content")) own.push_back(at.tile.at("content"));
    if (at.tile.has("contents")) {
      const JsonNode list = at.tile.at("contents").array();
      for (std::size_t i = 0; i < list.size(); ++i) own.push_back(list.element(i));
    }
    contents += own.size();
    if (!own.empty() && !found) {
      found = TileContent{.name = nameOf(own.front())};
      found->on_globe = glm::length(glm::dvec3(at.transform[3])) > kFarthest;
      if (!found->on_globe) {
        if (at.refused) at.refused->fail(at.wrong);
        found->scene_from_content = sceneFromContent(at.transform);
      }
    }
    if (!at.tile.has("children")) continue;
    const JsonNode children = at.tile.at("children").array();
    for (std::size_t i = 0; i < children.size(); ++i) {
      tiles.push_back({children.element(i).object(), at.transform, at.refused, at.wrong});
    }
  }
  if (contents != 1) {
    root.at("root").fail("holds " + std::to_string(contents) +
                         " files of content (expected one; each can be read by itself)");
  }
  return std::move(*found);
}

std::filesystem::path contentOfTileset(const std::filesystem::path& path) {
  return path.parent_path() / parseTileset(readFile(path, kMaxTilesetBytes), path.string()).name;
}

Bundle readTiles(const std::filesystem::path& path, const ReadOptions& options) {
  const TileContent content = parseTileset(readFile(path, kMaxTilesetBytes), path.string());
  const std::filesystem::path named = path.parent_path() / content.name;
  (void)FileReader(named, std::numeric_limits<std::uint64_t>::max());  // throws where it is no regular file
  Bundle loaded = readGltf(named, options, content.scene_from_content);
  if (content.on_globe) {
    loaded.warnings.emplace_back("the place on the globe is left out: the scene stands as its content does");
  }
  return loaded;
}

}  // namespace tg
