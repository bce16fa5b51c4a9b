// SPDX-License-Identifier: Apache-2.0
// What a model says of the photographs that it was trained on, for whoever scores it.
#pragma once
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/bundle/bundle.h"
#include "core/bundle/training_json.h"
#include "core/model/camera.h"

namespace tg {

struct TrainedOn {
  std::optional<glm::vec3> background;  // none: nobody chose it
  std::vector<Camera> cameras;          // which a data set that it is scored on should have, and as large; or none
  bool knows_split = false;             // Camera::test of these says what was held out
  std::optional<std::optional<Normalization>> normalized;  // normalizationOf()
};
TrainedOn trainedOn(const Bundle& bundle);

// What sets the world of a model apart from that of a data set that is normalized or not, as the end of a sentence
// about the model; "": nothing that is known. `by`: the option that normalizes, as the caller's user knows it.
std::string otherWorld(const TrainedOn& trained, bool normalized, const std::string& by);

// What to say where a training with the 3D filter goes on from the model of another one with it; "": nothing.
std::string filteredTwice(const std::string& training_json, bool filter_3d);

// What to say of a model that is scored on `views` of a data set, which is normalized or not: that it is of another
// world, was trained on other photographs, on such of another size, or on test views; a line each, without the
// model's name.
std::vector<std::string> notesOnViews(const TrainedOn& trained, const std::string& dataset, bool normalized,
                                      const std::string& by, std::span<const Camera> views);

}  // namespace tg
