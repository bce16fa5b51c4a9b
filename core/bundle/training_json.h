// SPDX-License-Identifier: Apache-2.0
// What every reader of a bundle's training.json asks.
#pragma once
#include <array>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace tg {

// The stages of a training in their order, and the settings that say how many iterations they have.
struct TrainingStage {
  std::string_view name, iterations;
};
inline constexpr std::array<TrainingStage, 5> kTrainingStages = {{{"count", "iterations"},
                                                                  {"plain", "iterations"},
                                                                  {"textured", "texture-iterations"},
                                                                  {"untextured", "texture-iterations"},
                                                                  {"quantized", "quantize-iterations"}}};

// Whether the training that made the model was stopped before its end. False for "" and for what does not say.
bool wasInterrupted(const std::string& training_json);

// Whether its held-out views were training views (--validation): the data set's test views are none of its cameras.
bool wasForValidation(const std::string& training_json);

// Whether it had --filter-3d: the model is of Gaussians as its filter left them (docs/math.md 8).
bool wasFiltered(const std::string& training_json);

// How a data set was moved and scaled before training (--normalize): x there is scale * (x - origin).
struct Normalization {
  double scale = 1;
  glm::dvec3 origin{0.0};  // [world units of the data set]
  bool operator==(const Normalization&) const = default;
};
// Of the data set that the model was trained on; none: it was taken as it is. Outer none: not known, as for "", for
// what does not say and for models edited since, which may have been brought back.
std::optional<std::optional<Normalization>> normalizationOf(const std::string& training_json);

// Writes down that the model is no longer what was trained and scored: "edited". Nothing to "".
void noteEdited(std::string& training_json);
bool wasEdited(const std::string& training_json);

// What to say of one that was interrupted.
constexpr const char* kInterruptedTraining = "its training was interrupted: no finished model";

}  // namespace tg
