// SPDX-License-Identifier: Apache-2.0
// Checks what can be checked first, trains, and writes what came of it.
#include "training/train.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <utility>

#include "converter/gltf/write_gltf.h"
#include "converter/registry/file_format.h"
#include "core/file/file.h"
#include "core/file/sha256.h"
#include "core/model/fallback.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "core/system/numbers.h"
#include "core/system/parallel.h"
#include "core/system/program.h"
#include "core/system/shell_word.h"
#include "core/system/signals.h"
#include "training/mpi/engine.h"
#include "training/outputs.h"
#include "training/photos/scan.h"
#include "training/plan.h"
#include "training/run/report.h"
#include "training/run/trained_bundle.h"
#include "training/run/trainer.h"
#include "training/score/trained_on.h"
#include "training/step/context.h"
#include "training/together.h"
#include "training/watch.h"
#include "training/watchers.h"
#include "training/write_scene.h"

namespace tg {
namespace fs = std::filesystem;

namespace {

std::atomic<bool> stop_requested{false};
std::atomic<int> stop_signal{0};

void requestStop(int signal) {
  int none = 0;
  if (!stop_signal.compare_exchange_strong(none, signal)) endAtOnce(signal);
  stop_requested = true;
}

// The model that --start-model names.
std::optional<Bundle> startModel(const TrainFlags& options) {
  if (options.start_model.empty()) return std::nullopt;
  return readModel(options.start_model);
}

// What is drawn around a block and stays: of the model that --context names what lies outside the part that is trained.
// None without the flag, and where nothing does.
std::optional<GaussianModel> contextOf(const TrainFlags& options, const Dataset& dataset) {
  if (options.context.empty()) return std::nullopt;
  const Bundle bundle = readModel(options.context);
  GaussianModel context = withoutTextures(bakeFallback(bundle.model, FallbackScale::fitted));
  if (dataset.block) {
    const Cell trained = dataset.block->cell.padded(dataset.block->padding);
    std::vector<std::uint32_t> outside;
    for (std::uint32_t i = 0; i < context.size(); ++i) {
      if (!trained.contains(glm::dvec3(context.mean[i]))) outside.push_back(i);
    }
    context = select(context, outside);
  }
  if (context.size() == 0) return std::nullopt;
  return context;
}

std::unique_ptr<RunFolder> openRunFolder(const TrainFlags& options) {
  if (options.run.folder.empty()) return nullptr;
  RunFolderOptions folder = options.run;
  folder.overwrite = options.overwrite;
  return std::make_unique<RunFolder>(folder);
}

// "64 x 64", or from the fewest to the most pixels of several sizes.
std::string sizesOf(const std::vector<Camera>& views) {
  const auto pixels = [](const Camera& view) { return std::int64_t{view.size.x} * view.size.y; };
  const auto text = [](glm::ivec2 size) { return std::to_string(size.x) + " x " + std::to_string(size.y); };
  const auto [least, most] = std::ranges::minmax(views, {}, pixels);
  const bool same = std::ranges::all_of(views, [&](const Camera& view) { return view.size == least.size; });
  return same ? text(least.size) : text(least.size) + " to " + text(most.size);
}

Dataset loadData(const TrainFlags& options, DatasetOptions data_options) {
  const bool begins = options.context.empty() && options.start_model.empty() && !options.run.resume;
  if (begins) data_options.normalize_by = "--normalize";
  ProgressLine line;
  if (!options.quiet) {
    data_options.decoded = [&](std::size_t done, std::size_t count) { line.show("decoding photographs", done, count); };
  }
  Dataset dataset = loadDataset(options.dataset, data_options);
  printNotes(options.dataset, dataset);
  if (options.talks()) {
    const std::size_t count = dataset.points.position.size();
    const std::string points = count > 0                     ? std::to_string(count) + " points"
                               : options.start_model.empty() ? "no points: random ones are the start"
                                                             : "no points";
    std::printf("%s: %zu train and %zu test views of %s (%s), %s\n", printable(dataset.name).c_str(),
                dataset.indices(false).size(), dataset.indices(true).size(), sizesOf(dataset.views).c_str(),
                std::string(name(dataset.layout)).c_str(), points.c_str());
    std::fflush(stdout);
  }
  return dataset;
}

// Throws where an output cannot hold so many cameras.
void requireStorable(const TrainFlags& options, const std::vector<Camera>& views) {
  const fs::path& run = options.run.folder;
  for (const fs::path& path :
       {run.empty() ? run : run / "model.tgz", fs::path(options.output), fs::path(options.untextured_output)}) {
    if (!path.empty()) requireStorable(modelFormat(path), path, views);
  }
}

// What of the flags decides how stage quantized goes.
FlagTexts quantizedFor(const TrainFlags& options) {
  return {{"target-size", options.target_bytes > 0 ? std::to_string(options.target_bytes) : "none"},
          {"steps", options.steps > 0 ? numberText(options.steps) : "none"},
          {"output", lowerExtension(options.output)}};
}

// What a training over several processes has no use for, or cannot do.
void refuseTogether(const TrainFlags& options) {
  if (options.device == "cuda") {
    throw Error(ErrorKind::usage, "--device cuda is for one process (expected auto or cpu under mpirun)");
  }
  if (!options.context.empty()) {
    throw Error(ErrorKind::usage, "--context is for one process (expected none under mpirun)");
  }
}

// This process's, of several a share.
DatasetOptions dataOptions(const TrainFlags& options, Processes* together) {
  DatasetOptions data = datasetOptions(options.data);
  if (together) takeShare(*together, options.threads, options.data.image_memory == 0, data);
  return data;
}

// Flags that say too little to begin, or name what is no data set.
void requireDataset(const TrainFlags& options) {
  const bool no_output = options.output.empty() && options.run.folder.empty();
  if (options.dataset.empty() || no_output) {
    const std::string output = "-o model.tgz or --run FOLDER (see --help)";
    throw Error(ErrorKind::usage, !no_output                ? "expected a data set (see --help)"
                                  : options.dataset.empty() ? "expected a data set and " + output
                                                            : options.dataset + ": expected " + output);
  }
  if (options.data.layout != "auto" || !isForPhotos(options.dataset)) return;
  const std::string near = isFile(options.dataset) ? "" : datasetNear(options.dataset);
  if (!near.empty()) throw Error(ErrorKind::badData, options.dataset, "not a data set" + near);
  throw Error(ErrorKind::badData, options.dataset,
              (isFile(options.dataset) ? "is a film" : "not a data set, but photographs without cameras") +
                  std::string(": `tgtrain photos ") + shellWord(options.dataset) +
                  " -o model.tgz` finds the cameras and trains");
}

// One training, at the first process where there are several.
class Training {
 public:
  // Both outlive this.
  Training(const TrainFlags& options, Processes* together) : options_(options), together_(together) {}

  // Returns the exit code.
  int run();

 private:
  using Clock = std::chrono::steady_clock;

  void load();
  void open();
  void settle();
  std::optional<RunState> begin();
  void stepToEnd(Trainer& trainer, Watchers& watchers);
  void sayWhatIsQuicker(const TrainProgress& progress);
  [[noreturn]] void keepWhatIsThere(Trainer& trainer, const Error& why);
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

  const TrainFlags& options_;
  Processes* const together_;
  const Clock::time_point start_ = Clock::now();
  std::optional<GaussianModel> start_model_;
  std::unique_ptr<PageServer> page_;
  std::unique_ptr<RunFolder> run_;
  std::string why_cpu_;
  std::unique_ptr<DifferentiableRenderer> renderer_;
  Dataset dataset_;
  std::optional<GaussianModel> context_;
  TrainSettings settings_;
  TrainingJsonOptions json_;
  bool on_cpu_ = false;
  bool said_quicker_ = false;
  bool storing_ = false;  // what is drawn is brought to the numbers of the file
  ProgressLine line_;
};

// All that is refused before there are photographs, then these.
void Training::load() {
  requireDataset(options_);
  if (together_) refuseTogether(options_);
  std::optional<Bundle> start = checkTraining(options_, together_ != nullptr);
  if (start) warnIdleSettings(options_, &start->model);
  if (!options_.serve.empty()) {
    page_ = servePage(options_.serve, options_.serve_token, nameOf(options_.title, options_.dataset),
                      {options_.dataset, options_.run.folder}, options_.json == kStandardOutput ? stderr : stdout);
  }
  run_ = openRunFolder(options_);
  checkOutputs(options_, run_ && run_->hasCheckpoint());
  if (!together_) renderer_ = openCuda(options_.device, why_cpu_);
  dataset_ = loadData(options_, dataOptions(options_, together_));
  requireStorable(options_, dataset_.views);
  if (!start) return;
  const std::string twice = filteredTwice(start->training_json, settingsOf(options_).filter_3d);
  if (!twice.empty()) std::fprintf(stderr, "tgtrain: %s\n", twice.c_str());
  if (!options_.quiet) {
    for (const std::string& warning : start->warnings)
      std::fprintf(stderr, "tgtrain: %s\n", printable(warning).c_str());
  }
  start_model_ = std::move(start->model);
}

void Training::open() {
  if (together_) {
    beginTogether(*together_, [&] { load(); }, dataset_);
    renderer_ = makeShardedRenderer(together_->channel(), dataset_);
  } else {
    load();
  }
  on_cpu_ = !renderer_;
  if (on_cpu_) renderer_ = makeCpuDifferentiableRenderer();
  context_ = contextOf(options_, dataset_);
  if (context_) renderer_ = withContext(std::move(renderer_), *context_);
  if (!why_cpu_.empty() && options_.talks()) std::printf("training on the CPU (%s)\n", why_cpu_.c_str());
  handleStopSignals(requestStop);
}

void Training::settle() {
  settings_ = settingsOf(options_);
  const GaussianModel* start = start_model_ ? &*start_model_ : nullptr;
  const std::string said = planRecipe(options_, trainingPixels(dataset_), start, !together_, settings_);
  if (!said.empty() && options_.talks()) std::printf("%s\n", said.c_str());
  json_.downscale = options_.data.downscale;
  json_.threads = threadCount();
  json_.device = renderer_->deviceName();
  json_.measurements = !options_.reproducible;
}

// What a run folder has to go on from, if there is one.
std::optional<RunState> Training::begin() {
  if (!run_) return std::nullopt;
  json_.fingerprint = datasetFingerprint(dataset_);
  std::optional<RunState> state =
      run_->begin({dataset_, settings_, start_model_ ? &*start_model_ : nullptr, json_, &stop_requested,
                   quantizedFor(options_), context_ ? &*context_ : nullptr});
  const float steps = state ? state->file_steps : 0;
  if (steps != 0 && !(steps >= kLeastSteps && steps <= kMostSteps)) {
    throw Error(ErrorKind::badData, run_->checkpoint().string(),
                "file_steps: expected " + numberText(kLeastSteps) + " to " + numberText(kMostSteps) + ", found " +
                    numberText(steps));
  }
  if (options_.run.resume && !state && options_.talks()) {
    std::printf("%s: no checkpoint yet: training starts anew\n", printable(options_.run.folder.string()).c_str());
  }
  if (options_.watch) startViewer(run_->folder(), options_.dataset);
  return state;
}

// Throws `why`, with where the model is that training has come to.
void Training::keepWhatIsThere(Trainer& trainer, const Error& why) {
  std::optional<Bundle> bundle;
  try {
    std::optional<TrainResult> kept = storing_ ? trainer.result() : trainer.takePlain();
    line_.finish();
    json_.total_seconds = seconds();
    if (kept) bundle = makeTrainedBundle(dataset_, settings_, kept->report, std::move(kept->model), json_);
  } catch (const std::exception&) {
    // The first reason says more.
  }
  throw bundle ? keepModel(options_.output, *std::move(bundle), why) : why;
}

// Once, where the rest takes hours, which a first try may not be meant to.
void Training::sayWhatIsQuicker(const TrainProgress& progress) {
  constexpr int kJudged = 100;    // steps, before which an estimate says little
  constexpr double kLong = 3600;  // [s]
  // Over the preset's; --config names all settings.
  const bool has_iterations = std::ranges::any_of(options_.chosen, [](const auto& setting) {
    const auto& [entry, value] = setting;
    return !value.empty() && (entry->name == "iterations" || entry->name == "texture-iterations");
  });
  const bool preset = options_.preset != "quick" && options_.settings_file.empty() && !has_iterations;
  const bool downscale = options_.data.downscale == 1;
  if (said_quicker_ || !on_cpu_ || options_.run.resume || !(preset || downscale)) return;
  if (progress.iteration < kJudged || progress.seconds_left < kLong) return;
  said_quicker_ = true;
  line_.finish();
  const std::string quicker = !preset     ? "--downscale 2"
                              : downscale ? "--preset quick or --downscale 2"
                                          : "--preset quick";
  // Not how long: what densification will add is not known yet.
  std::fprintf(stderr, "tgtrain: an hour or more on the CPU (%s for a first look)\n", quicker.c_str());
}

void Training::stepToEnd(Trainer& trainer, Watchers& watchers) {
  while (!trainer.finished()) {
    watchers.beforeStep(trainer);
    if (stop_requested) break;
    try {
      if (!trainer.step(&stop_requested)) continue;
    } catch (const std::exception& error) {
      // The file cannot be written, which its trial says before the end, or textures have no room.
      const auto* named = dynamic_cast<const Error*>(&error);
      const bool no_memory = dynamic_cast<const std::bad_alloc*>(&error) != nullptr;
      if (run_ || !(storing_ || named || no_memory)) throw;
      keepWhatIsThere(trainer, named       ? *named
                               : no_memory ? Error(ErrorKind::device, "out of memory")
                                           : Error(ErrorKind::cannotWrite, options_.output, error.what()));
    }
    if (!options_.quiet) {
      const TrainProgress progress = trainer.progress();
      line_.show(progress);
      sayWhatIsQuicker(progress);
    }
    if (run_) run_->afterStep(trainer);
    watchers.afterStep(trainer);
  }
  line_.finish();
}

int Training::run() {
  open();
  settle();
  std::optional<RunState> state = begin();
  Trainer trainer = state ? Trainer(dataset_, settings_, *renderer_, std::move(*state))
                          : Trainer(dataset_, settings_, *renderer_, std::exchange(start_model_, {}));
  state.reset();
  start_model_.reset();
  trainer.onQuantizing([&](const GaussianModel& model, float& steps) {
    storing_ = true;
    if (options_.steps > 0) steps = options_.steps;
    GaussianModel stored = asStored(options_.output, model, options_.target_bytes, steps);
    storing_ = false;
    return stored;
  });
  Watchers watchers(dataset_, run_.get(), page_.get(), stop_requested,
                    MetricsLog(options_.run.metrics_every, options_.run.eval_every));
  trainer.onScoring([&](std::size_t done, std::size_t views) {
    if (!options_.quiet) line_.show("scoring test views", done, views);
    watchers.scoring(trainer, done, views);
  });
  stepToEnd(trainer, watchers);

  TrainResult result = trainer.result();
  json_.total_seconds = seconds();
  const TrainReport report = result.report;
  TrainingOutputs outputs(options_, dataset_, settings_, run_.get());
  outputs.write(trainer, std::move(result), json_);
  if (options_.talks()) outputs.say(report);
  watchers.finish(trainer);
  // As a shell reports a program that the signal ended: what comes after `&&` is for finished models.
  // An order to stop is as Ctrl-C.
  return report.interrupted ? 128 + (stop_signal > 0 ? stop_signal.load() : SIGINT) : 0;
}

}  // namespace

std::optional<Bundle> checkTraining(const TrainFlags& options, bool together) {
  TrainSettings settings = settingsOf(options);
  if (options.target_bytes > 0 || options.steps > 0) partOfSog(options.output);  // refuses what has none
  if (options.serve.empty() && !options.serve_token.empty()) {
    throw Error(ErrorKind::usage, "--serve-token is of a page (expected --serve with it)");
  }
  if (!options.serve.empty()) parseServe(options.serve, options.serve_token);
  if (options.run.folder.empty() && (options.run.resume || options.watch)) {
    const std::string flag = !options.watch ? "--resume" : !options.run.resume ? "--watch" : "--resume and --watch";
    const std::string expects = options.run.resume && options.watch ? " expect" : " expects";
    throw Error(ErrorKind::usage, flag + expects + " a run folder (--run FOLDER)");
  }
  if (options.watch) requireViewer();
  checkDatasetOptions(datasetOptions(options.data));
  if (!options.context.empty() && options.data.normalize) {
    throw Error(ErrorKind::usage, "--context is of the data set's own world (expected no --normalize)");
  }
  if (!options.context.empty() && !isFile(options.context)) {
    throw Error(ErrorKind::cannotRead, options.context, "no such file");
  }
  std::optional<Bundle> start = startModel(options);
  const std::string other = start ? otherWorld(trainedOn(*start), options.data.normalize, "--normalize") : "";
  if (!other.empty()) throw Error(ErrorKind::usage, options.start_model, other + " (expected both of one world)");
  const GaussianModel* model = start ? &start->model : nullptr;
  planRecipe(options, 0, model, !together, settings);
  checkTrainable(settings, model, !together);
  return start;
}

std::string trainingMadeOf(const TrainFlags& options) {
  const DatasetFlags& data = options.data;
  std::string text = formatSettings(settingsOf(options));
  const auto contentOf = [](const std::string& file) {
    return isFile(file) ? sha256Hex(readFile(file, std::numeric_limits<std::uint64_t>::max())) : "";
  };
  for (const std::string& part :
       {options.start_model, options.context, data.background, data.images, data.points, data.masks,
        contentOf(options.start_model), contentOf(options.context), contentOf(data.points),
        std::to_string(data.downscale), std::to_string(data.test_every), std::to_string(data.validation)}) {
    text += part + "\n";
  }
  if (data.normalize) text += "normalize\n";
  if (options.target_bytes > 0 || options.steps > 0) {
    for (const auto& [name, value] : quantizedFor(options)) text += name + " " + value + "\n";
  }
  return text;
}

void checkData(const TrainFlags& options) {
  const Dataset dataset = loadDataset(options.dataset, datasetOptions(options.data));
  requireStorable(options, dataset.views);
  (void)contextOf(options, dataset);
}

std::string nameOf(const std::string& title, const fs::path& path) {
  std::error_code ignored;
  return title.empty() ? fs::weakly_canonical(path, ignored).filename().string() : title;
}

int train(const TrainFlags& options, Processes* together) {
  if (options.print_config) {
    if (together) together->endTogether();
    if (!together || together->isFirst()) std::fputs(formatSettings(settingsOf(options)).c_str(), stdout);
    return 0;
  }
  if (options.threads > 0) setThreadCount(options.threads);
  if (together && !together->isFirst()) {
    return followFirst(*together, options.dataset, [&] { return dataOptions(options, together); });
  }
  std::signal(SIGPIPE, SIG_IGN);  // as handleStopSignals() has it, for what is said before
  const int code = Training(options, together).run();
  if (together) endTogether(*together, code);
  return code;
}

bool stopRequested() { return stop_requested; }

}  // namespace tg
