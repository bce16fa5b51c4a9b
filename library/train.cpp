// SPDX-License-Identifier: Apache-2.0
// Training, by the CPU's trainer.
#include "textured_gaussians/train.h"

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/system/nearest_name.h"
#include "core/system/shortened.h"
#include "library/access.h"
#include "training/run/trainer.h"
#include "training/score/trained_on.h"
#include "training/settings/idle.h"

namespace textured_gaussians {
namespace {

// Flags of tgtrain that are no settings, and what has them here.
struct OtherFlag {
  const char* name;
  const char* place;
};
constexpr const char* kOfDataset = "is an option of the data set";
constexpr const char* kOfLoading = "is an option of Dataset::load() (Python: Dataset.load())";
constexpr const char* kOfProgram = "is tgtrain's alone";
constexpr OtherFlag kOtherFlags[] = {
    {"start-model", "is no setting: give the model itself, loaded, as start"},
    {"preset", "is no setting, but an argument of its own"},
    {"threads", "is set for all that the library does, by setThreads() (Python: set_threads)"},
    {"downscale", kOfLoading},
    {"background", kOfDataset},
    {"test-every", kOfDataset},
    {"normalize", kOfLoading},
    {"output", kOfProgram},
    {"target-size", kOfProgram},
    {"steps", kOfProgram},
    {"untextured-output", kOfProgram},
    {"json", kOfProgram},
    {"reproducible", kOfProgram},
    {"overwrite", kOfProgram},
    {"quiet", kOfProgram},
    {"layout", kOfProgram},
    {"validation", kOfProgram},
    {"masks", kOfProgram},
    {"image-folder", kOfProgram},
    {"image-memory", kOfProgram},
    {"points", kOfProgram},
    {"config", kOfProgram},
    {"print-config", kOfProgram},
    {"context", kOfProgram},
    {"device", kOfProgram},
    {"run", kOfProgram},
    {"resume", kOfProgram},
    {"checkpoint-every", kOfProgram},
    {"metrics-every", kOfProgram},
    {"eval-every", kOfProgram},
    {"preview-every", kOfProgram},
    {"watch", kOfProgram},
    {"serve", kOfProgram},
    {"serve-token", kOfProgram},
};

[[noreturn]] void refuseUnknown(const std::string& name) {
  const auto other = std::ranges::find(kOtherFlags, name, &OtherFlag::name);
  if (other != std::end(kOtherFlags)) throw tg::Error(tg::ErrorKind::usage, name, other->place);
  std::vector<std::string> names;
  for (const tg::SettingEntry& entry : tg::settingEntries()) names.push_back(entry.name);
  const std::string near = tg::nearestName(name, names);
  throw tg::Error(
      tg::ErrorKind::usage, calledBy(name),
      "no such setting (" + (near.empty() ? "docs/training.md has them" : "did you mean " + near + "?") + ")");
}

using Settings = std::map<std::string, std::string>;

// By their names alone. Throws tg::Error(usage).
Settings namedSettings(const TrainOptions& options) {
  Settings named;
  for (const auto& [given, value] : options.settings) {
    const auto [place, added] = named.emplace(withoutDashes(given), value);
    if (!added) throw tg::Error(tg::ErrorKind::usage, calledBy(place->first), "is given twice");
  }
  return named;
}

tg::TrainSettings settingsOf(const TrainOptions& options, const std::optional<Model>& start) {
  tg::TrainSettings settings = tg::presetSettings(tg::shortened(options.preset));
  const Settings named = namedSettings(options);
  const auto names = [&](const char* setting) { return named.contains(setting); };
  for (const auto& [name, value] : named) {
    const auto entry = std::ranges::find(tg::settingEntries(), name, &tg::SettingEntry::name);
    if (entry == tg::settingEntries().end()) refuseUnknown(name);
    if (name == "start" && !tg::parse<tg::Start>(value)) {
      throw tg::Error(tg::ErrorKind::usage, name,
                      "expected " + tg::allNames<tg::Start>(", ") + " or a model that is loaded, found '" +
                          tg::shortened(value) + "'");
    }
    entry->set(settings, tg::shortened(value));  // no value is as long
  }
  // As tgtrain has it: what is named goes over what the preset or the start model says.
  if (names("percent") && !names("gaussians") && settings.percent > 0) settings.gaussians = 0;
  if (names("gaussians") && !names("percent") && settings.gaussians > 0) settings.percent = 0;
  if (start && !names("intersection")) {
    const tg::GaussianModel& model = Access::bundle(*start)->model;
    if (!tg::isTextured(model)) settings.intersection = model.intersection;
  }
  if (settings.quantize_iterations > 0) {
    throw tg::Error(tg::ErrorKind::usage, "--quantize-iterations", "is for a file that tgtrain writes (expected 0)");
  }
  tg::checkSettings(settings);
  return settings;
}

std::vector<std::string> warningsOf(const TrainOptions& options, const std::optional<Model>& start,
                                    const tg::TrainSettings& settings) {
  const Settings named = namedSettings(options);
  const auto chosen = [&](const tg::SettingEntry& entry) { return named.contains(entry.name); };
  const std::shared_ptr<const tg::Bundle> bundle = start ? Access::bundle(*start) : nullptr;
  std::vector<std::string> warnings = tg::idleSettings(settings, chosen, bundle ? &bundle->model : nullptr, false);
  if (!bundle) return warnings;
  const std::string twice = tg::filteredTwice(bundle->training_json, settings.filter_3d);
  if (!twice.empty()) warnings.push_back(twice);
  return warnings;
}

std::optional<tg::GaussianModel> startOf(const std::optional<Model>& start, const tg::Dataset& data) {
  if (!start) return std::nullopt;
  const std::shared_ptr<const tg::Bundle> bundle = Access::bundle(*start);
  const std::string other = tg::otherWorld(tg::trainedOn(*bundle), data.normalized.has_value(), "normalize");
  if (!other.empty()) {
    throw tg::Error(tg::ErrorKind::usage, "start", "the model " + other + " (expected both of one world)");
  }
  return bundle->model;
}

}  // namespace

struct Trainer::Parts {
  Parts(const Dataset& dataset, const TrainOptions& options, const std::optional<Model>& start)
      : data(Access::dataset(dataset)),
        trainer(*data, settingsOf(options, start), *renderer, startOf(start, *data)),
        warnings(warningsOf(options, start, trainer.settings())) {}

  std::shared_ptr<const tg::Dataset> data;
  std::unique_ptr<tg::DifferentiableRenderer> renderer = tg::makeCpuDifferentiableRenderer();
  tg::Trainer trainer;
  const std::vector<std::string> warnings;
  std::mutex in_use;
};

Trainer::Trainer(const Dataset& dataset, const TrainOptions& options, const std::optional<Model>& start)
    : parts_(guarded([&] { return std::make_unique<Parts>(dataset, options, start); })) {}
Trainer::~Trainer() = default;
Trainer::Trainer(Trainer&&) noexcept = default;
Trainer& Trainer::operator=(Trainer&&) noexcept = default;

std::vector<std::string> Trainer::warnings() const { return parts_->warnings; }

bool Trainer::step() {
  const std::lock_guard lock(parts_->in_use);
  return guarded([&] { return parts_->trainer.step(); });
}

TrainProgress Trainer::progress() const {
  const std::lock_guard lock(parts_->in_use);
  return guarded([&] {
    const tg::TrainProgress progress = parts_->trainer.progress();
    return TrainProgress{std::string(tg::name(progress.stage)),
                         progress.iteration,
                         progress.iterations,
                         progress.loss,
                         progress.psnr,
                         progress.gaussians,
                         progress.seconds_left};
  });
}

Model Trainer::model() const {
  const std::lock_guard lock(parts_->in_use);
  return guarded([&] {
    tg::Bundle bundle;
    bundle.model = parts_->trainer.result().model;
    bundle.cameras = parts_->data->views;
    bundle.background = parts_->data->background;
    return Access::model(std::move(bundle));
  });
}

}  // namespace textured_gaussians
