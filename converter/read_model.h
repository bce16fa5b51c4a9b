// SPDX-License-Identifier: Apache-2.0
// A model from any file the toolchain reads: model.tgz, INRIA's splat PLY, compressed PLY, .splat, SPZ, and glTF with
// KHR_gaussian_splatting.
#pragma once
#include <filesystem>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "core/model.h"

namespace tg {

struct ReadProgress;

struct LoadedModel {
  GaussianModel model;
  std::vector<Camera> cameras;
  glm::vec3 background{0.0f};         // what the model was trained against; black where the file does not say
  std::vector<std::string> warnings;  // what was repaired or skipped, one line each, without the path
  std::string format;                 // as name(FileFormat) has it
  std::string training_json;          // tgz only; "" = none
  Image preview;                      // tgz only; empty = none
};

struct ReadOptions {
  ReadProgress* progress = nullptr;  // of tgz and PLY; may be null
  bool base_only = false;  // glTF: leave the texture layer aside, as a reader that knows only the Khronos extension
};

// Told apart by content; .splat, which has no magic number, by its extension. The model has passed checkModel. Throws
// Error(cannotRead / badData); formats that are known but not supported are named. ReadCancelled: options.progress
// said so.
LoadedModel readModel(const std::filesystem::path& path, const ReadOptions& options = {});

}  // namespace tg
