// SPDX-License-Identifier: Apache-2.0
// What of a scene with levels of detail is in memory: a model that has every leaf at one level, and what has been read
// for the next one.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/glm.hpp>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <stop_token>
#include <utility>
#include <vector>

#include "converter/lod/lod_scene.h"
#include "core/system/error.h"
#include "viewer/view/scene.h"

namespace tg {

// The lod-meta.json is another one than the one that was opened: its files are not of one scene.
struct SceneRewritten : Error {
  explicit SceneRewritten(const std::filesystem::path& path)
      : Error(ErrorKind::cannotRead, path.string(), "was written again while it was read") {}
};

// A scene with levels of detail, and where its files come from.
struct OpenedLevels {
  LodScene scene;
  LodReader reader;  // of one thread at a time; throws ReadCancelled once `stop` was asked for
  // Asks the disk, or the server where it answered at last. Throws SceneRewritten, ReadCancelled as `reader`, and
  // Error(cannotRead) where the file seems to be another one and cannot be read.
  std::function<void()> require_same;
  std::vector<Camera> cameras;
  std::vector<std::string> warnings;
};
// A lod-meta.json on disk or at an http address. Throws Error(usage / cannotRead / badData) and ReadCancelled.
OpenedLevels openLevels(const std::filesystem::path& path, const std::stop_token& stop);

// Levels are [leaves]. Nothing here has threads; memory is that of two models and of what has been read since.
class ResidentLevels {
 public:
  // Reads the coarsest level, which stays: no leaf is ever without one. `scene` must outlive this. `require_same` is
  // called after each file; empty: it stays as it is. Throws what both and readLodFile() throw, and Error(device) where
  // there is not enough memory.
  ResidentLevels(const LodScene& scene, LodReader reader, std::function<void()> require_same = {});

  const std::shared_ptr<const GaussianModel>& model() const { return model_; }
  const std::vector<std::uint8_t>& levels() const { return levels_; }  // of the model

  // The files that leaves lack at their wanted levels, those of the leaves nearest to `eye` first.
  std::vector<std::uint32_t> missing(std::span<const std::uint8_t> wanted, glm::dvec3 eye) const;
  // Reads a file, and keeps of it the leaves that want and lack it. Throws as the constructor.
  void read(std::uint32_t file, std::span<const std::uint8_t> wanted);
  std::uint64_t bytesRead() const { return bytes_read_; }        // of files, so far
  std::uint64_t bytesWaiting() const { return bytes_waiting_; }  // of what has been read since the model was made
  // Wanted levels where they are there, else what the model has, but at most `budget` Gaussians: then leaves that are
  // finer than wanted become coarse first.
  std::vector<std::uint8_t> reachable(std::span<const std::uint8_t> wanted, std::uint64_t budget) const;
  // The model of these levels, all of which are there. What was read for others is dropped.
  void assemble(std::span<const std::uint8_t> levels);

 private:
  // Where Gaussians of a leaf lie.
  struct Place {
    const GaussianModel* model = nullptr;  // null: not in memory
    std::uint32_t first = 0;
  };
  Place placeOf(std::size_t leaf, std::uint8_t level) const;
  std::shared_ptr<const GaussianModel> joined(std::span<const std::uint8_t> levels) const;
  GaussianModel readFile(std::uint32_t file);
  std::vector<std::uint32_t> startsOf(std::span<const std::uint8_t> levels) const;

  const LodScene& scene_;
  const LodReader reader_;
  const std::function<void()> require_same_;
  std::vector<std::uint8_t> coarsest_levels_, levels_;
  std::shared_ptr<const GaussianModel> coarsest_, model_;
  std::vector<std::uint32_t> coarsest_starts_, starts_;  // [leaves] in the models
  std::vector<std::unique_ptr<const GaussianModel>> pieces_;
  std::map<std::pair<std::size_t, std::uint8_t>, Place> waiting_;  // by leaf and level, in `pieces_`
  std::uint64_t bytes_read_ = 0, bytes_waiting_ = 0;
};

// The levels with the next coarser ones for those whose file is in `lost`, down to the coarsest.
std::vector<std::uint8_t> withoutFiles(const LodScene& scene, std::vector<std::uint8_t> levels,
                                       const std::set<std::uint32_t>& lost);

// What a viewer knows of a streamed scene with that model.
Scene sceneOf(const OpenedLevels& opened, std::shared_ptr<const GaussianModel> model,
              const std::filesystem::path& path);

}  // namespace tg
