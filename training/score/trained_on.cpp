// SPDX-License-Identifier: Apache-2.0
// Cameras of a model beside those of a data set.
#include "training/score/trained_on.h"

#include <algorithm>

#include "core/system/error.h"

namespace tg {
namespace {

std::string sizeText(const Camera& camera) {
  return std::to_string(camera.size.x) + " x " + std::to_string(camera.size.y);
}

}  // namespace

TrainedOn trainedOn(const Bundle& bundle) {
  TrainedOn trained;
  trained.knows_split = !bundle.training_json.empty();
  trained.normalized = normalizationOf(bundle.training_json);
  const bool is_exact = bundle.format == "tgz" || bundle.format.empty();  // other files round cameras
  if (is_exact && !wasForValidation(bundle.training_json)) trained.cameras = bundle.cameras;
  // What was trained elsewhere, or went through a format that lacks it, has a background that nobody chose; cameras are
  // lost on the same ways.
  if (bundle.knows_background && (bundle.format == "tgz" || !bundle.cameras.empty())) {
    trained.background = bundle.background;
  }
  return trained;
}

std::string otherWorld(const TrainedOn& trained, bool normalized, const std::string& by) {
  if (!trained.normalized || trained.normalized->has_value() == normalized) return "";
  return normalized ? "was trained without " + by + ", and the data set is read with it"
                    : "was trained with " + by + ", and the data set is read without it";
}

std::string filteredTwice(const std::string& training_json, bool filter_3d) {
  if (!filter_3d || !wasFiltered(training_json)) return "";
  return "--filter-3d: the start model is as the filter of its own training left it, and is filtered once more";
}

std::vector<std::string> notesOnViews(const TrainedOn& trained, const std::string& dataset, bool normalized,
                                      const std::string& by, std::span<const Camera> views) {
  std::vector<std::string> notes;
  if (const std::string other = otherWorld(trained, normalized, by); !other.empty()) return {other};
  if (trained.cameras.empty()) return notes;
  // Edited models' cameras move with them, by computation.
  constexpr double kSame = 1e-6;
  const auto same = [](const Camera& a, const Camera& b) {
    double turned = 0;
    for (int axis = 0; axis < 3; ++axis) turned += glm::distance(a.rotation[axis], b.rotation[axis]);
    return turned < kSame && glm::distance(a.translation, b.translation) < kSame * (1 + glm::length(a.translation));
  };
  const auto cameraOf = [&](const Camera& view) {
    return std::ranges::find_if(trained.cameras, [&](const Camera& camera) { return same(camera, view); });
  };
  const auto held_out = [](const Camera& view) { return view.test; };
  const auto seen = std::ranges::count_if(views, [&](const Camera& view) {
    const auto camera = cameraOf(view);
    return view.test && camera != trained.cameras.end() && !camera->test;
  });
  if (trained.knows_split && seen > 0) {
    notes.push_back("was trained on " + std::to_string(seen) + " of the " +
                    std::to_string(std::ranges::count_if(views, held_out)) + " test views (--test-every)");
  }
  for (const Camera& view : views) {
    const auto camera = cameraOf(view);
    if (camera == trained.cameras.end()) continue;
    if (camera->size != view.size) {
      notes.push_back("was trained on photographs of " + sizeText(*camera) + ", and is scored on " + sizeText(view) +
                      " (--downscale)");
    }
    return notes;
  }
  notes.push_back("none of its " + std::to_string(trained.cameras.size()) + " cameras is among the views of " +
                  printable(dataset) + ": was it trained on others?");
  return notes;
}

}  // namespace tg
