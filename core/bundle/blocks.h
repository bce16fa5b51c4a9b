// SPDX-License-Identifier: Apache-2.0
// A scene in blocks: the cells of its ground plane, each trained by itself. blocks.json lists them; block.json is a
// data set, some of the photographs of another one (docs/scale.md).
#pragma once
#include <cstddef>
#include <filesystem>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tg {

// Upright and endless. The cells of a scene cover all of space, no two the same point.
struct Cell {
  glm::dvec3 u{1, 0, 0}, v{0, 1, 0};  // unit vectors along the ground, at right angles
  glm::dvec2 low, high;               // [world units] along them; infinite at the scene's rim

  glm::dvec2 at(const glm::dvec3& point) const { return {glm::dot(point, u), glm::dot(point, v)}; }
  bool contains(const glm::dvec3& point) const {
    const glm::dvec2 p = at(point);
    return p.x >= low.x && p.x < high.x && p.y >= low.y && p.y < high.y;
  }
  Cell padded(double by) const {
    Cell wider = *this;
    wider.low -= by;
    wider.high += by;
    return wider;
  }
};

struct SceneBlock {
  std::string name;  // of its folder
  Cell cell;
  double padding = 0;  // [world units] around the cell that is trained, too, and cropped then
};

// block.json
struct BlockFile {
  SceneBlock block;
  std::string dataset;             // the whole one, as seen from the block's folder
  std::string layout;              // of the whole one
  std::vector<std::string> views;  // photographs, as paths below the whole one's folder
};

inline constexpr const char* kBlocksName = "blocks.json";
inline constexpr const char* kBlockName = "block.json";

// Both throw Error(cannotWrite).
void writeBlocks(const std::filesystem::path& folder, const std::vector<SceneBlock>& blocks);
void writeBlock(const std::filesystem::path& folder, const BlockFile& file);

// Throws Error(cannotRead / badData): also where a name is no folder's, axes are none and cells overlap.
std::vector<SceneBlock> readBlocks(const std::filesystem::path& folder);
// None for a folder without block.json. Throws Error(cannotRead / badData), also for a block without photographs.
std::optional<BlockFile> readBlock(const std::filesystem::path& folder);
// The folder of the data set that the block in `folder` is of. Throws Error(cannotRead) where it is not there, or an
// empty folder.
std::filesystem::path wholeDataset(const std::filesystem::path& folder, const BlockFile& block);

}  // namespace tg
