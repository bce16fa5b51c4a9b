// SPDX-License-Identifier: Apache-2.0
// A trained model as a file: with the data set's cameras, a preview and training.json.
#pragma once
#include "core/bundle/bundle.h"
#include "training/run/report.h"

namespace tg {

// The preview is the first test view, at most 512 px a side, drawn by the CPU: a GPU that a training fills has no room
// for the model once more.
Bundle makeTrainedBundle(const Dataset& dataset, const TrainSettings& settings, const TrainReport& report,
                         GaussianModel model, const TrainingJsonOptions& options);

// What previews show: the first test view, or the first view where there is no test.
std::size_t previewView(const Dataset& dataset);

}  // namespace tg
