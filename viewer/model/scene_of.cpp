// SPDX-License-Identifier: Apache-2.0
// From files to scenes; training.json is read without trust.
#include "viewer/model/scene_of.h"

#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "core/bundle/training_json.h"
#include "core/file/json.h"
#include "core/system/error.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

int whole(const nlohmann::json& object, std::string_view key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return 0;
  const double value = found->get<double>();
  return value >= 0 && value <= 1e9 ? static_cast<int>(value) : 0;
}

const nlohmann::json* member(const nlohmann::json& object, std::string_view key) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(key);
  return found == object.end() || !found->is_object() ? nullptr : &*found;
}

}  // namespace

Scene sceneOf(Bundle loaded, const std::filesystem::path& path) {
  Scene scene;
  scene.path = path;
  scene.format = std::move(loaded.format);
  scene.background = loaded.background;
  scene.knows_background = loaded.knows_background;
  scene.warnings = std::move(loaded.warnings);
  scene.up = sceneUp(loaded.cameras);
  scene.cameras = std::move(loaded.cameras);
  scene.views = std::move(loaded.views);
  const TrainingProgress progress = trainingProgress(loaded.training_json);
  scene.training = formatProgress(progress);
  if (progress.finished && progress.held_out > 0) {
    scene.training = formatted("finished, %.2f dB held out", progress.held_out);
  } else if (progress.psnr > 0) {
    scene.training += formatted(", %.2f dB in training", progress.psnr);
  }
  if (!scene.training.empty() && wasEdited(loaded.training_json)) scene.training += kBeforeEdits;
  scene.training_json = std::move(loaded.training_json);
  scene.model = std::make_shared<const GaussianModel>(std::move(loaded.model));
  measure(scene);
  return scene;
}

TrainingProgress trainingProgress(const std::string& training_json) {
  TrainingProgress progress;
  if (training_json.empty()) return progress;
  nlohmann::json json;
  try {
    json = parseJson(training_json, "training.json");
  } catch (const Error&) {
    return progress;
  }
  const nlohmann::json* stages = member(json, "stages");
  if (!stages) return progress;
  progress.finished = !wasInterrupted(training_json);
  // The stage that the run is in is the last one with steps; stages not begun have none. Stage untextured trains
  // another model for comparison: what this file holds is no part of it.
  const nlohmann::json* const settings = member(json, "settings");
  for (const auto& [stage, iterations] : kTrainingStages) {
    const nlohmann::json* report = member(*stages, stage);
    if (!report || (progress.finished && stage == "untextured") ||
        (!progress.stage.empty() && whole(*report, "iterations") == 0)) {
      continue;
    }
    progress.stage = stage;
    progress.iteration = whole(*report, "iterations");
    progress.iterations = settings ? whole(*settings, iterations) : 0;
    const auto decibels = [&](const char* key) {
      const auto psnr = report->find(key);
      return psnr != report->end() && psnr->is_number() ? psnr->get<double>() : 0;
    };
    progress.psnr = decibels("train_psnr");
    progress.held_out = decibels("test_psnr");
  }
  return progress;
}

std::string formatProgress(const TrainingProgress& progress) {
  if (progress.stage.empty()) return "";
  std::string text = progress.stage + " " + std::to_string(progress.iteration);
  if (progress.iterations > 0) text += " / " + std::to_string(progress.iterations);
  return text;
}

}  // namespace tg
