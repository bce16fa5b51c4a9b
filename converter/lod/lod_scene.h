// SPDX-License-Identifier: Apache-2.0
// A scene in levels of detail, as PlayCanvas streams SOG: lod-meta.json with a tree of leaves, and a folder of images
// for some leaves at one level (docs/lod.md).
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "converter/lod/split.h"
#include "core/bundle/bundle.h"
#include "core/model/camera.h"
#include "core/model/model.h"

namespace tg {

constexpr int kMaxLodLevels = 16;
constexpr const char* kLodMetaName = "lod-meta.json";
constexpr std::uint64_t kMaxLodMetaBytes = std::uint64_t{64} << 20;

// Gaussians [first, first + count) of a file.
struct LodRange {
  std::uint32_t file = 0, first = 0, count = 0;
  bool operator==(const LodRange&) const = default;
};

struct LodLeaf {
  Box bound;                     // around its Gaussians of all levels, to 3 sigma
  Box means;                     // around the means of level 0; foreign files do not say it: the bound
  std::vector<LodRange> levels;  // [levels] the finest first; a file that lacks one repeats the next finer or coarser
};

struct LodScene {
  std::string path;  // of lod-meta.json: what messages begin with
  int levels = 1;
  std::vector<std::string> files;          // meta.json of a SOG each, relative to the folder of lod-meta.json
  std::vector<std::uint32_t> file_counts;  // [files] Gaussians that ranges name
  std::vector<LodLeaf> leaves;             // in the tree's order
  std::vector<std::uint64_t> counts;       // [levels] Gaussians of all leaves
  std::vector<std::string> warnings;       // of what lod-meta.json says of itself
  bool has_environment = false;            // what foreign files show in any case, such as a sky: not read
  // What only our files say:
  std::optional<int> sh_degree;
  TextureMode texture_mode = TextureMode::none;  // of level 0
  IntersectionModel intersection = IntersectionModel::maxResponse;
  TextureOutside outside = TextureOutside::base;
  std::optional<glm::vec3> background;  // of a model that knew none: none
  std::string cameras;  // a cameras.json, relative as files are; "": none
};

// Bytes of a file by its name relative to the folder of lod-meta.json, at most so many. Throws Error as readFile()
// does.
using LodReader = std::function<std::vector<std::uint8_t>(const std::string& relative, std::uint64_t most)>;
// Of a folder. From any number of threads.
LodReader lodFolderReader(const std::filesystem::path& lod_meta);

// By its name.
bool isLodMeta(const std::filesystem::path& path);
// Names of files stay inside the folder. Throws Error(badData), readLodScene Error(cannotRead), too.
LodScene parseLodScene(std::span<const std::uint8_t> json, const std::string& path);
LodScene readLodScene(const std::filesystem::path& path);
// Of scene.cameras; none where the file names none.
std::vector<Camera> readLodCameras(const LodScene& scene, const LodReader& reader);
// The same for who can do without: of cameras that cannot be read there are none, and a warning.
std::vector<Camera> readLodCameras(const LodScene& scene, const LodReader& reader, std::vector<std::string>& warnings);
// A file's Gaussians, at least file_counts[file], and its warnings; base_only: what readers without textures get.
// Throws Error(cannotRead / badData).
Bundle readLodFile(const LodScene& scene, std::uint32_t file, const LodReader& reader, bool base_only = false);
// Where both have textures: throws Error(badData), of what was found in the file, unless they can be one model.
void requireSameTextures(const LodScene& scene, std::uint32_t file, const GaussianModel& found,
                         const GaussianModel& others);

// ---- A level for every leaf: [leaves]

// Leaves in view become finer one level at a time, first where the squared distance of their Gaussians on the screen is
// largest, until it is at most `least_pixels`^2 or a next level would bring the sum above `budget`; the others keep the
// coarsest level, all of them where the budget is less than that. A larger budget makes no leaf coarser. docs/lod.md
// has the numbers, which web/src computes alike to the last bit.
std::vector<std::uint8_t> chooseLevels(const LodScene& scene, const Pinhole& camera, std::uint64_t budget,
                                       double least_pixels = 1.0);
std::vector<std::uint8_t> sameLevel(const LodScene& scene, int level);
// Gaussians.
std::uint64_t countOf(const LodScene& scene, std::span<const std::uint8_t> levels);
// Ascending, each once.
std::vector<std::uint32_t> filesOf(const LodScene& scene, std::span<const std::uint8_t> levels);
// The leaves in their order, out of what readLodFile() gave for filesOf(). One SH degree in all files, one
// intersection model and one way for textures to end in those with textures, else Error(badData).
GaussianModel assembleLod(const LodScene& scene, std::span<const std::uint8_t> levels,
                          const std::function<const GaussianModel&(std::uint32_t file)>& file);

}  // namespace tg
