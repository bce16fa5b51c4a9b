// SPDX-License-Identifier: Apache-2.0
// Models that were read, as scenes.
#pragma once
#include <filesystem>
#include <string>

#include "converter/registry/file_format.h"
#include "viewer/view/scene.h"

namespace tg {

// A model's numbers, counted once.
Scene sceneOf(Bundle loaded, const std::filesystem::path& path);

// What training.json says about how far the run is. Never throws: a file without it, or with another JSON, has none.
struct TrainingProgress {
  std::string stage;    // "plain", "textured", ...; "" = none
  int iteration = 0;    // done in the stage
  int iterations = 0;   // of the stage; 0: not said
  double psnr = 0;      // [dB] of the training views, running mean
  double held_out = 0;  // [dB] of the test views; 0: not said
  bool finished = true;
};
TrainingProgress trainingProgress(const std::string& training_json);
std::string formatProgress(const TrainingProgress& progress);  // "plain 1200 / 7000"; "" = none

}  // namespace tg
