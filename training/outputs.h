// SPDX-License-Identifier: Apache-2.0
// The files that a training leaves: the model, the one without textures, the report; and what is said of them.
#pragma once
#include <optional>
#include <string>

#include "core/system/error.h"
#include "training/run/run_folder.h"
#include "training/run/trained_bundle.h"
#include "training/run/trainer.h"
#include "training/train_flags.h"
#include "training/write_scene.h"

namespace tg {

// Before hours of training: what could not be written at their end. resumes: what its run wrote, it may replace. Throws
// Error(usage / cannotWrite), and what ownershipOf() throws.
void checkOutputs(const TrainFlags& options, bool resumes);

// Writes what came of a training once. All outlive this; `run` is null for one without a folder.
class TrainingOutputs {
 public:
  TrainingOutputs(const TrainFlags& options, const Dataset& dataset, const TrainSettings& settings, RunFolder* run);

  // `result` is the trainer's; of `json` the seconds are those so far. Throws what writeScene() throws, and
  // Error(cannotWrite) where the run's last checkpoint or model could not be written: when all else is, with where the
  // model is then.
  void write(const Trainer& trainer, TrainResult result, TrainingJsonOptions json);
  // On stdout: scores, what was written and how to go on. `report` is of what was written.
  void say(const TrainReport& report) const;

 private:
  std::string finishRun(const Trainer& trainer);
  void sayIfFewGrew(const TrainReport& report, const std::string& file) const;
  std::string withOutput(const std::string& training_json) const;
  std::string sameCommand() const;
  Error whyUnfinished() const;
  template <typename Write>
  void writeOutput(const std::string& path, const Write& write);
  std::string save(const std::string& path, GaussianModel model, const TrainSettings& settings,
                   const TrainReport& report, SceneSize size);

  const TrainFlags& options_;
  const Dataset& dataset_;
  const TrainSettings& settings_;
  RunFolder* const run_;
  TrainingJsonOptions json_;
  std::optional<Error> unfinished_;  // why the run has no last checkpoint or model
  bool owned_ = true;                // by the run, what was written: else it does not replace that when it goes on
  std::optional<WrittenScene> written_;  // the output, where there is one
  bool too_large_ = false;           // which is not written, then
  bool untextured_ = false;          // written
};

}  // namespace tg
