// SPDX-License-Identifier: Apache-2.0
// model.tgz: a gzipped tar that holds the model, its texture atlases, its cameras and how it was trained.
// docs/bundle.md describes every entry and every limit.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/model/camera.h"
#include "core/model/model.h"

namespace tg {

struct ReadProgress;

// A model with what comes along in a file. Only model.tgz holds all of it but the views.
struct Bundle {
  GaussianModel model;
  std::vector<Camera> cameras;
  std::vector<Camera> views;          // named places to look from, the first one to start with: .glb, .gltf and .html
  std::string training_json;          // "" = none. Free-form JSON object: configuration, metrics, times
  Image preview;                      // empty = none; 3 channels, at most 512 px a side
  glm::vec3 background{0.0f};         // what the model was trained against; black where a file does not say
  bool knows_background = true;       // false: a file does not say
  std::string format;                 // filled by readModel(): the name of the file's format
  std::optional<glm::vec3> axes;      // filled by readers of files in others than their format's: a sign a coordinate
                                      // that makes the model's of the file's
  // Filled by readers, a line each, without the path: what broke its format's rules and was put right, which
  // readModel() moves before the warnings; what was skipped or guessed.
  std::vector<std::string> repairs, warnings;
};

// Bounds that are checked before anything is allocated. Raise them for trusted files.
struct BundleLimits {
  std::uint64_t entry_bytes = std::uint64_t{4} << 30;
  std::uint64_t total_bytes = std::uint64_t{8} << 30;
  std::uint64_t max_texels = kMaxModelTexels;
  int entries = 4096;
};

// Streams the archive; nothing is unpacked to disk. `progress` may be null. Throws Error(cannotRead / badData),
// ReadCancelled.
Bundle readBundle(const std::filesystem::path& path, const BundleLimits& limits = {}, ReadProgress* progress = nullptr);

// Same bundle in, same bytes out (no times, no user names; texels are stored as half floats). Atomic. Throws
// Error(cannotWrite).
void writeBundle(const std::filesystem::path& path, const Bundle& bundle);

}  // namespace tg
