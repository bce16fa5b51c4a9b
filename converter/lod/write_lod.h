// SPDX-License-Identifier: Apache-2.0
// Writes a scene in levels of detail.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/bundle/bundle.h"

namespace tg {

struct LodOptions {
  std::size_t leaf = 8192;   // Gaussians of a leaf at most, at level 0
  std::size_t file = 65536;  // Gaussians of a file at most, but for one leaf's; up to here SH of a file are not shared
  std::size_t coarsest = 65536;  // levels end with the first that has no more Gaussians
  std::size_t merged = 4;        // Gaussians that become one of the next level
};

struct LodReport {
  std::vector<std::uint64_t> counts;  // [levels] Gaussians
  std::size_t files = 0;
  std::uint64_t bytes = 0;           // of lod-meta.json and all files
  std::uint64_t clipped_texels = 0;  // of all levels, as sogFiles() counts them
  std::vector<std::uint32_t> order;  // Gaussian j of level 0 is Gaussian order[j] of the model
};

// `path` is lod-meta.json, or ends so; files go into a folder beside it, made under a temporary name and named by the
// first number that is free. What lod-meta.json named before is removed once the new one has its place, so that at any
// moment it names whole files. Its own folder is made if it is not there. Same model in, same bytes out, into an empty
// folder. Throws Error(badData) for a model without Gaussians, Error(cannotWrite).
LodReport writeLod(const std::filesystem::path& path, const Bundle& source, const LodOptions& options = {});

}  // namespace tg
