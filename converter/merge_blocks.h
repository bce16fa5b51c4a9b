// SPDX-License-Identifier: Apache-2.0
// A scene that was trained in blocks becomes one model again.
#pragma once
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace tg {

struct MergedBlock {
  std::string name;
  std::size_t trained = 0;  // Gaussians
  std::size_t kept = 0;     // of them, in its cell
};

struct MergeReport {
  std::vector<MergedBlock> blocks;
  std::size_t gaussians = 0;
  std::vector<std::string> warnings;
};

// `blocks`: what tgtrain split wrote. `models`: a folder with NAME/model.tgz, as a farm's results are, or NAME.tgz of
// each. Of each block the Gaussians whose mean lies in its cell come, with their textures and the block's cameras; one
// model is in memory beside the result. Written as `output` says by its extension. Throws Error(usage) for what is no
// model's name, Error(cannotRead) for a model that is not there, Error(badData) for backgrounds that differ and where
// nothing is left, Error(cannotWrite), and what reading and merging throw.
MergeReport mergeBlocks(const std::filesystem::path& blocks, const std::filesystem::path& models,
                        const std::filesystem::path& output, bool overwrite);

}  // namespace tg
