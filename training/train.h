// SPDX-License-Identifier: Apache-2.0
// One training, from flags to files.
#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "core/bundle/bundle.h"
#include "training/mpi/launch.h"
#include "training/train_flags.h"

namespace tg {

// Before hours of work, those of COLMAP among them: all that is wrong whatever the photographs are. Returns the start
// model, if there is one. Throws Error.
std::optional<Bundle> checkTraining(const TrainFlags& options, bool together = false);

// What is wrong with the flags for the data set that is there. Throws Error.
void checkData(const TrainFlags& options);

// What a training from photographs depends on beside them.
std::string trainingMadeOf(const TrainFlags& options);

// `title`, or without one what a path is called, also with a slash at its end.
std::string nameOf(const std::string& title, const std::filesystem::path& path);

class Processes;  // training/mpi/processes.h

// Returns the exit code: 0, or as a shell has it 128 + the signal that ended training. The first Ctrl-C, kill or closed
// terminal ends it after the current step and writes the model; the second ends the program at once, with no file half
// written. Throws Error.
int train(const TrainFlags& options, Processes* together = nullptr);

// Whether a signal came, be it after the last step.
bool stopRequested();

}  // namespace tg
