// SPDX-License-Identifier: Apache-2.0
// What every reader of a bundle's training.json asks.
#pragma once
#include <string>

namespace tg {

// Whether the training that made the model was stopped before its end. False for "" and for what does not say.
bool wasInterrupted(const std::string& training_json);

// What to say of such a model.
constexpr const char* kInterruptedTraining = "its training was interrupted: no finished model";

}  // namespace tg
