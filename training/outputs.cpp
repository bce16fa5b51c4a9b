// SPDX-License-Identifier: Apache-2.0
// Owns each file of a run before it is written, so that who is killed meanwhile finds it again.
#include "training/outputs.h"

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>
#include <vector>

#include "converter/registry/file_format.h"
#include "core/file/atomic_files.h"
#include "core/file/file.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "training/plan.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

// After it was not written: what is there is another's. The error that says why is what matters.
void disown(const RunFolder& run, const fs::path& file) {
  try {
    run.setOwn(file, false);
  } catch (const Error&) {
  }
}

}  // namespace

void checkOutputs(const TrainFlags& options, bool resumes) {
  const std::vector<std::string> paths = {options.output, options.untextured_output, options.json};
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const std::string& path = paths[i];
    if (path.empty() || (&path == &paths.back() && path == kStandardOutput)) continue;
    const Format* format = &path == &paths.back() ? nullptr : &modelFormat(path);
    for (std::size_t j = 0; j < i; ++j) {
      if (!paths[j].empty() && placeOfOutput(path) == placeOfOutput(paths[j])) {
        throw Error(ErrorKind::usage, path, "is named for two outputs (expected different files)");
      }
    }
    for (const std::string& other : paths) {
      if (!format || other.empty() || &other == &path || !writesToo(*format, path, other)) continue;
      throw Error(ErrorKind::usage, other, "is written beside " + path + ", too (expected another name)");
    }
    const fs::path& run = options.run.folder;
    std::error_code unknown;
    for (const std::string& input : {options.start_model, options.context}) {  // which --resume would read again
      if (run.empty() || input.empty() || placeOfOutput(path) != fs::weakly_canonical(fs::absolute(input), unknown))
        continue;
      throw Error(ErrorKind::usage, path, "is what training starts from (expected another name with a run folder)");
    }
    for (const char* own :
         {"model.tgz", "checkpoint", "metrics.jsonl", "outputs.json", "live.tgz", "live.json", "control", "previews"}) {
      if (run.empty() || placeOfOutput(path) != placeOfOutput(run / own)) continue;
      throw Error(ErrorKind::usage, path, "is written in any case, by the run folder (expected another name)");
    }
    if (format) {
      requireWritable(*format, path);
    } else {
      requireWritable(path);
    }
    const Ownership ownership = resumes ? ownershipOf(run, path) : Ownership::others;
    if (ownership == Ownership::changed && !options.overwrite) {
      throw Error(ErrorKind::cannotWrite, path,
                  "has changed since this run wrote it (add --overwrite to replace it, or name another output)");
    }
    const bool replaces = options.overwrite || ownership == Ownership::own;
    refuseExisting(path, replaces);
    if (!format) continue;
    for (const fs::directory_entry& entry : fs::directory_iterator(placeOfOutput(path).parent_path(), unknown)) {
      const fs::path beside = fs::path(path).parent_path() / entry.path().filename();
      if (writesToo(*format, path, beside)) refuseExisting(beside.string(), replaces);
    }
  }
}

TrainingOutputs::TrainingOutputs(const TrainFlags& options, const Dataset& dataset, const TrainSettings& settings,
                                 RunFolder* run)
    : options_(options), dataset_(dataset), settings_(settings), run_(run) {}

// Calls write(replace) for an output, which says whether it wrote it. What a run wrote when it was stopped, it replaces
// when it goes on.
template <typename Write>
void TrainingOutputs::writeOutput(const std::string& path, const Write& write) {
  const bool was_own = run_ && run_->owns(path), replace = options_.overwrite || was_own;
  bool owned = true;
  std::error_code ignored;
  if (run_ && (replace || !fs::exists(path, ignored))) {
    try {
      run_->setOwn(path, true);
    } catch (const Error&) {
      if (!unfinished_) throw;
      owned = false;
    }
  }
  bool wrote = false;
  try {
    wrote = write(replace);
  } catch (const Error& error) {
    if (run_ && !was_own) disown(*run_, path);
    if (!unfinished_) throw;
    throw Error(error.kind, error.what() + ("; " + std::string(whyUnfinished().what())));
  }
  if (run_ && !wrote && !was_own) disown(*run_, path);
  if (!run_ || !wrote) return;
  owned_ = owned_ && owned;
  try {
    run_->markWritten(path);
  } catch (const Error&) {
    // It is then as one that is being written, and what is written matters more.
  }
}

// Returns the model's training.json.
std::string TrainingOutputs::save(const std::string& path, GaussianModel model, const TrainSettings& settings,
                                  const TrainReport& report, SceneSize size) {
  Bundle bundle = makeTrainedBundle(dataset_, settings, report, std::move(model), json_);
  std::string training_json = bundle.training_json;
  const std::string kept = run_ && !unfinished_ && path == options_.output ? run_->model().string() : "";
  writeOutput(path, [&](bool replace) {
    try {
      const WrittenScene written = writeScene(path, std::move(bundle), replace, kept, options_.quiet, size);
      if (path == options_.output) written_ = written;
      return true;
    } catch (const Error& error) {
      // What a training was stopped at may be larger than what would have come of it.
      if (!report.interrupted || size.bytes == 0 || error.kind != ErrorKind::usage) throw;
      std::fprintf(stderr, "tgtrain: %s\n", error.what());
      too_large_ = true;
      return false;
    }
  });
  return training_json;
}

// Returns the model's training.json, or "" where it is unfinished_.
std::string TrainingOutputs::finishRun(const Trainer& trainer) {
  try {
    return run_->finish(trainer);
  } catch (const Error& error) {
    if (error.kind != ErrorKind::cannotWrite) throw;
    unfinished_ = error;
    return "";
  }
}

// By which the run goes on.
std::string TrainingOutputs::sameCommand() const {
  std::string flags = options_.goes_on || options_.run.resume ? "" : " --resume";
  if (!owned_) flags += " --overwrite";
  return "the same command" + (flags.empty() ? flags : " with" + flags);
}

Error TrainingOutputs::whyUnfinished() const {
  std::string why = unfinished_->what();
  const std::string& last = run_->lastCheckpoint();
  if (!last.empty()) why += "; the last checkpoint is of " + last + ", from which " + sameCommand() + " goes on";
  return {unfinished_->kind, why};
}

void TrainingOutputs::write(const Trainer& trainer, TrainResult result, TrainingJsonOptions json) {
  json_ = std::move(json);
  const SceneSize size{options_.target_bytes, options_.steps > 0 ? options_.steps : trainer.fileSteps()};
  std::string training_json;
  if (run_) {
    training_json = finishRun(trainer);
    json_.total_seconds = run_->seconds();
  }
  std::optional<Error> unfinished;
  if (options_.output.empty()) {
    if (unfinished_) {
      const Bundle bundle = makeTrainedBundle(dataset_, settings_, result.report, std::move(result.model), json_);
      training_json = bundle.training_json;
      unfinished = keepModel(run_->model().string(), bundle, whyUnfinished());
    }
  } else if (run_ && !unfinished_ && outputFormat(options_.output).name == "tgz") {
    writeOutput(options_.output, [&](bool replace) {
      writeAfterTraining(
          options_.output, replace, [&] { copyFileAtomically(run_->model(), options_.output); },
          [&] { return run_->model().string(); });
      written_ = WrittenScene{.bytes = fs::file_size(options_.output)};
      return true;
    });
  } else {
    const std::string saved = save(options_.output, std::move(result.model), settings_, result.report, size);
    if (training_json.empty()) training_json = saved;
  }
  untextured_ = !options_.untextured_output.empty() && result.untextured;
  if (untextured_) {
    // Of what it went through alone.
    TrainSettings settings = settings_;
    settings.texture_mode = TextureMode::none;
    settings.compare_untextured = false;
    TrainReport report = result.report;
    report.textured.reset();
    save(options_.untextured_output, std::move(*result.untextured), settings, report, {});
  }
  if (written_ && !options_.json.empty()) training_json = withOutput(training_json);
  if (options_.json == kStandardOutput) {
    std::fputs(training_json.c_str(), stdout);
  } else if (!options_.json.empty()) {
    writeOutput(options_.json, [&](bool replace) {
      const KeepExisting no_other_run(!replace);
      writeTextAtomically(options_.json, training_json);
      return true;
    });
  }
  if (unfinished) throw *unfinished;
  if (unfinished_) {
    const Error why = whyUnfinished();
    throw Error(why.kind, why.what() + (too_large_ ? "" : " (the model is kept as " + options_.output + ")"));
  }
}

// training.json as --json writes it. Of the file, which holds the same without it.
std::string TrainingOutputs::withOutput(const std::string& training_json) const {
  using Json = nlohmann::ordered_json;
  Json json = Json::parse(training_json);
  Json& output = json["output"];
  output["name"] = fs::path(options_.output).filename().string();  // no folders, as elsewhere in it
  output["file_format"] = outputFormat(options_.output).name;
  output["bytes"] = written_->bytes;
  if (options_.target_bytes > 0) output["target_bytes"] = options_.target_bytes;
  if (written_->steps > 0) output["steps"] = written_->steps;
  if (written_->psnr && std::isfinite(*written_->psnr)) output["psnr"] = std::round(*written_->psnr * 1e4) / 1e4;
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

// What leaves the file smaller than was asked: fewer than were planned for it.
void TrainingOutputs::sayIfFewGrew(const TrainReport& report, const std::string& file) const {
  constexpr double kFull = 0.98;  // of the Gaussians, of the size: what --target-size comes within
  const auto lacks = [](auto part, auto whole) {
    return static_cast<double>(part) < kFull * static_cast<double>(whole);
  };
  const bool grows = settings_.iterations > 0 && settings_.densification != Densification::none;
  const std::size_t grown = report.plain.gaussians, planned = settings_.gaussians;
  if (report.interrupted || !grows || grown == 0 || !plansCount(options_, settings_) || !lacks(grown, planned)) return;
  std::error_code unknown;
  const std::uintmax_t bytes = fs::file_size(file, unknown);
  if (unknown || !lacks(bytes, options_.target_bytes)) return;
  std::printf("%zu of %zu planned Gaussians grew: more iterations may fill the file\n", grown, planned);
}

void TrainingOutputs::say(const TrainReport& report) const {
  const std::string name = options_.output.empty() ? run_->model().string() : options_.output;
  std::fputs(formatSummary(report, json_.total_seconds).c_str(), stdout);
  if (too_large_) {
    std::printf("interrupted; %s is not written\n", name.c_str());
  } else {
    std::printf("%s%s (%ju bytes%s)\n", report.interrupted ? "interrupted; wrote " : "wrote ", name.c_str(),
                std::uintmax_t{written_ ? written_->bytes : fs::file_size(name)},
                written_ && written_->psnr ? formatted(", %.1f dB to the model", *written_->psnr).c_str() : "");
  }
  sayIfFewGrew(report, name);
  if (untextured_) std::printf("wrote %s, without textures\n", options_.untextured_output.c_str());
  if (run_ && report.interrupted) {
    std::printf("%s goes on from %s\n", sameCommand().c_str(), run_->checkpoint().c_str());
  }
  std::fflush(stdout);
}

}  // namespace tg
