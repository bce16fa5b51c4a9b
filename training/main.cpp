// SPDX-License-Identifier: Apache-2.0
// tgtrain: flags to settings, signals to a clean end, errors to exit codes.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "converter/registry/file_format.h"
#include "core/file/atomic_files.h"
#include "core/file/file.h"
#include "core/model/fallback.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "core/system/parallel.h"
#include "core/system/program.h"
#include "core/system/signals.h"
#include "training/cli.h"
#include "training/data/sample.h"
#include "training/data/write_dataset.h"
#include "training/farm_flags.h"
#include "training/mpi/engine.h"
#include "training/mpi/launch.h"
#include "training/photos/scan.h"
#include "training/photos_flags.h"
#include "training/plot.h"
#include "training/run/report.h"
#include "training/run/run_folder.h"
#include "training/run/size_plan.h"
#include "training/run/trained_bundle.h"
#include "training/run/trainer.h"
#include "training/settings/schedule.h"
#include "training/split_flags.h"
#include "training/step/context.h"
#include "training/together.h"
#include "training/watch.h"
#include "training/watchers.h"
#include "training/write_scene.h"

namespace {

namespace fs = std::filesystem;

std::atomic<bool> stop_requested{false};
std::atomic<int> stop_signal{0};

// The first Ctrl-C ends training after the current step and writes the model; the second ends the program at once, with
// no file half written.
void requestStop(int signal) {
  int none = 0;
  if (!stop_signal.compare_exchange_strong(none, signal)) tg::endAtOnce(signal);
  stop_requested = true;
}

struct Options {
  std::string dataset;
  std::string output;
  std::string untextured_output;
  std::string start_model;
  std::string context;
  std::string json;
  tg::RunFolderOptions run;
  tg::DatasetFlags data;
  std::string preset = "default";
  std::uint64_t target_bytes = 0;                         // of the output; 0: any
  float steps = 0;                                        // of the output; 0: its own, or what target_bytes leave
  std::map<const tg::SettingEntry*, std::string> chosen;  // over the preset; empty: not given
  bool from_file = false;                                 // --config is given, and has chosen all
  std::set<const tg::SettingEntry*> by_flag;              // which of them flags have chosen, then
  std::string device = "auto";
  int threads = 0;
  bool overwrite = false;
  bool watch = false;
  std::string serve, serve_token;
  std::string title;  // of the page; "": the data set's name
  bool quiet = false;
  bool reproducible = false;
  bool print_config = false;
};

// Before hours of training: what could not be written at their end.
void checkOutputs(const Options& options, bool overwrite) {
  const std::vector<std::string> paths = {options.output, options.untextured_output, options.json};
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const std::string& path = paths[i];
    if (path.empty()) continue;
    const bool model = &path != &paths.back();
    if (model && !tg::outputFormat(path).read) {
      throw tg::Error(tg::ErrorKind::usage, path,
                      "is no model format (expected " + tg::listed(tg::outputNames(true)) + ")");
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (fs::path(path).lexically_normal() == fs::path(paths[j]).lexically_normal()) {
        throw tg::Error(tg::ErrorKind::usage, path, "is named for two outputs (expected different files)");
      }
    }
    tg::refuseExisting(path, overwrite);
    tg::requireWritable(path);
  }
}

tg::TrainSettings settingsOf(const Options& options) {
  tg::TrainSettings settings = tg::presetSettings(options.preset);
  for (const auto& [entry, value] : options.chosen) {
    if (!value.empty()) entry->set(settings, value == "true" ? "on" : value == "false" ? "off" : value);
  }
  settings.compare_untextured |= !options.untextured_output.empty();
  if (options.target_bytes == 0) tg::checkSettings(settings);  // else what is planned completes them
  return settings;
}

// The model that --start-model names.
std::optional<tg::Bundle> startModel(const Options& options) {
  if (options.start_model.empty()) return std::nullopt;
  return tg::readModel(options.start_model);
}

// What is drawn around a block and stays: of the model that --context names what lies outside the part that is trained.
// None without the flag, and where nothing does.
std::optional<tg::GaussianModel> contextOf(const Options& options, const tg::Dataset& dataset) {
  if (options.context.empty()) return std::nullopt;
  const tg::Bundle bundle = tg::readModel(options.context);
  tg::GaussianModel context = tg::withoutTextures(tg::bakeFallback(bundle.model));
  if (dataset.block) {
    const tg::Cell trained = dataset.block->cell.padded(dataset.block->padding);
    std::vector<std::uint32_t> outside;
    for (std::uint32_t i = 0; i < context.size(); ++i) {
      if (!trained.contains(glm::dvec3(context.mean[i]))) outside.push_back(i);
    }
    context = tg::select(context, outside);
  }
  if (context.size() == 0) return std::nullopt;
  return context;
}

// Whether a flag says it, or a file of settings, which names them all, other than the preset.
template <typename Named>
bool given(const Options& options, const tg::TrainSettings& settings, const Named& named) {
  const tg::TrainSettings preset = tg::presetSettings(options.preset);
  return std::ranges::any_of(options.chosen, [&](const auto& setting) {
    const tg::SettingEntry& entry = *setting.first;
    const bool by_flag = !options.from_file || options.by_flag.contains(&entry);
    const bool chosen = !setting.second.empty() && (by_flag || entry.get(settings) != entry.get(preset));
    return chosen && named(std::string_view(entry.name));
  });
}

// What nobody chose, so that the output has room for it, by what is best at equal bytes (docs/frontier.md): SH degree
// 1, and no textures where neither a flag nor the start model speaks of them. Returns what to say of it.
std::string planSize(const Options& options, std::uint64_t training_pixels, bool textured_start,
                     tg::TrainSettings& settings) {
  const auto given = [&](const auto& named) { return ::given(options, settings, named); };
  const auto is = [](std::initializer_list<std::string_view> names) {
    return [names](std::string_view name) { return std::ranges::find(names, name) != names.end(); };
  };
  const bool speaks_of_textures = settings.compare_untextured || given([](std::string_view name) {
                                    return name.find("texture") != name.npos || name.find("texel") != name.npos;
                                  });
  const bool counted = given(is({"gaussians", "percent"})), sized = given(is({"texture-size"}));
  const bool shared_out = given(is({"adaptive-texels", "texel-budget"}));
  const bool timed = given(is({"iterations", "densify-until"}));
  if (!given(is({"sh-degree"}))) settings.sh_degree = tg::kPlannedShDegree;
  if (!speaks_of_textures && !textured_start && settings.iterations > 0) {
    settings.texture_mode = tg::TextureMode::none;
    if (!timed) {
      settings.densify_until = tg::makeSchedule(settings).densify_until;  // what is longer is for what stands
      settings.iterations += settings.texture_iterations;
    }
  }
  const bool textured = settings.texture_mode != tg::TextureMode::none;
  const tg::SizePlan plan = tg::planForSize(options.target_bytes, tg::partOfSog(options.output), training_pixels,
                                            settings.sh_degree, settings.texture_mode);
  if (!counted) settings.gaussians = plan.gaussians;
  if (textured && !shared_out) {
    settings.adaptive_texels = static_cast<float>(plan.texels);
    if (!sized) settings.texture_size = tg::kPlannedTextureSize;
  }
  tg::checkSettings(settings);
  std::string said =
      tg::formatted("planned for %ju bytes: SH degree %d", std::uintmax_t{options.target_bytes}, settings.sh_degree);
  if (!counted) said += tg::formatted(", %zu Gaussians", settings.gaussians);
  if (textured && !shared_out) said += tg::formatted(", %.1f texels each", plan.texels);
  return said;
}

// For a file of coarser numbers, where nobody said how long: as long as it pays (docs/lab/quality.md).
constexpr int kQuantizedShare = 10;  // of the iterations of the other stages
void planQuantizing(const Options& options, tg::TrainSettings& settings) {
  const bool coarse = options.target_bytes > 0 || options.steps > 0;
  if (settings.quantize_iterations > 0 && !coarse) {
    throw tg::Error(tg::ErrorKind::usage,
                    "--quantize-iterations is for a file of coarser numbers (expected --target-size or --steps)");
  }
  const auto says = [](std::string_view name) { return name == "quantize-iterations"; };
  if (!coarse || settings.compare_untextured || given(options, settings, says)) return;
  const bool textured = settings.texture_mode != tg::TextureMode::none;
  settings.quantize_iterations = (settings.iterations + (textured ? settings.texture_iterations : 0)) / kQuantizedShare;
}

// Before hours of work, those of COLMAP among them: all that is wrong whatever the photographs are. Returns the start
// model, if there is one.
std::optional<tg::Bundle> checkTraining(const Options& options) {
  tg::TrainSettings settings = settingsOf(options);
  if (options.target_bytes > 0 || options.steps > 0) tg::partOfSog(options.output);  // refuses what has none
  if (options.serve.empty() && !options.serve_token.empty()) {
    throw tg::Error(tg::ErrorKind::usage, "--serve-token is of a page (expected --serve with it)");
  }
  if (!options.serve.empty()) tg::parseServe(options.serve, options.serve_token);
  if (options.run.folder.empty() && (options.run.resume || options.watch)) {
    const std::string flag = !options.watch ? "--resume" : !options.run.resume ? "--watch" : "--resume and --watch";
    const std::string expects = options.run.resume && options.watch ? " expect" : " expects";
    throw tg::Error(tg::ErrorKind::usage, flag + expects + " a run folder (--run FOLDER)");
  }
  if (options.watch) tg::requireViewer();
  tg::datasetOptions(options.data);
  std::optional<tg::Bundle> start = startModel(options);
  if (options.target_bytes > 0) planSize(options, 0, start && tg::isTextured(start->model), settings);
  planQuantizing(options, settings);
  return start;
}

std::unique_ptr<tg::RunFolder> openRunFolder(const Options& options) {
  if (options.run.folder.empty()) return nullptr;
  tg::RunFolderOptions folder = options.run;
  folder.overwrite = options.overwrite;
  return std::make_unique<tg::RunFolder>(folder);
}

tg::Dataset loadData(const Options& options, tg::DatasetOptions data_options) {
  tg::ProgressLine line;
  if (!options.quiet) {
    data_options.decoded = [&](std::size_t done, std::size_t count) { line.show("decoding photographs", done, count); };
  }
  tg::Dataset dataset = tg::loadDataset(options.dataset, data_options);
  const tg::Camera& camera = dataset.views.front();
  tg::printNotes(options.dataset, dataset);
  if (!options.quiet) {
    const std::size_t count = dataset.points.position.size();
    const std::string points = count > 0                     ? std::to_string(count) + " points"
                               : options.start_model.empty() ? "no points: random ones are the start"
                                                             : "no points";
    std::printf("%s: %zu train and %zu test views of %d x %d (%s), %s\n", dataset.name.c_str(),
                dataset.indices(false).size(), dataset.indices(true).size(), camera.size.x, camera.size.y,
                std::string(tg::name(dataset.layout)).c_str(), points.c_str());
    std::fflush(stdout);
  }
  return dataset;
}

// `title`, or without one what a path is called, also with a slash at its end.
std::string nameOf(const std::string& title, const fs::path& path) {
  std::error_code ignored;
  return title.empty() ? fs::weakly_canonical(path, ignored).filename().string() : title;
}

// What of the flags decides how stage quantized goes.
tg::FlagTexts quantizedFor(const Options& options) {
  return {{"target-size", std::to_string(options.target_bytes)},
          {"steps", tg::numberText(options.steps)},
          {"output", fs::path(options.output).extension().string()}};
}

// What a training over several processes has no use for, or cannot do.
void refuseTogether(const Options& options) {
  if (options.device == "cuda") {
    throw tg::Error(tg::ErrorKind::usage, "--device cuda is for one process (expected auto or cpu under mpirun)");
  }
  if (!options.context.empty()) {
    throw tg::Error(tg::ErrorKind::usage, "--context is for one process (expected none under mpirun)");
  }
}

int runTraining(const Options& options, tg::Processes* together = nullptr) {
  if (options.print_config) {
    if (together) together->endTogether();
    if (!together || together->isFirst()) std::fputs(tg::formatSettings(settingsOf(options)).c_str(), stdout);
    return 0;
  }
  if (options.threads > 0) tg::setThreadCount(options.threads);
  const auto data_options = [&] {
    tg::DatasetOptions data = tg::datasetOptions(options.data);
    if (together) tg::takeShare(*together, options.threads, options.data.image_memory == 0, data);
    return data;
  };
  if (together && !together->isFirst()) return tg::followFirst(*together, options.dataset, data_options);

  const auto seconds = [start = std::chrono::steady_clock::now()] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  std::optional<tg::Bundle> start_bundle;
  std::unique_ptr<tg::PageServer> page;
  std::unique_ptr<tg::RunFolder> run;
  bool replace = false;
  std::string why_cpu;
  std::unique_ptr<tg::DifferentiableRenderer> renderer;
  tg::Dataset dataset;
  const auto load = [&] {
    const bool no_output = options.output.empty() && options.run.folder.empty();
    if (options.dataset.empty() || no_output) {
      const std::string output = "-o model.tgz or --run FOLDER (see --help)";
      throw tg::Error(tg::ErrorKind::usage, !no_output                ? "expected a data set (see --help)"
                                            : options.dataset.empty() ? "expected a data set and " + output
                                                                      : options.dataset + ": expected " + output);
    }
    if (options.data.layout == "auto" && tg::isForPhotos(options.dataset)) {
      throw tg::Error(tg::ErrorKind::badData, options.dataset,
                      (tg::isFile(options.dataset) ? "is a film" : "not a data set, but photographs without cameras") +
                          std::string(": `tgtrain photos ") + options.dataset +
                          " -o model.tgz` finds the cameras and trains");
    }
    if (together) refuseTogether(options);
    start_bundle = checkTraining(options);
    if (!options.serve.empty()) {
      page = tg::servePage(options.serve, options.serve_token, nameOf(options.title, options.dataset));
    }
    run = openRunFolder(options);
    // What a run wrote when it was stopped, it replaces when it goes on.
    replace = options.overwrite || (run && run->hasCheckpoint());
    checkOutputs(options, replace);
    if (!together) renderer = tg::openCuda(options.device, why_cpu);
    dataset = loadData(options, data_options());
  };
  if (together) {
    tg::beginTogether(*together, load, dataset);
    renderer = tg::makeShardedRenderer(together->channel(), dataset);
  } else {
    load();
  }
  if (!renderer) renderer = tg::makeCpuDifferentiableRenderer();
  const std::optional<tg::GaussianModel> context = contextOf(options, dataset);
  if (context) renderer = tg::withContext(std::move(renderer), *context);
  if (!why_cpu.empty() && !options.quiet) std::printf("training on the CPU (%s)\n", why_cpu.c_str());
  tg::handleStopSignals(requestStop);
  tg::TrainingJsonOptions json_options;
  json_options.downscale = options.data.downscale;
  json_options.threads = tg::threadCount();
  json_options.device = renderer->deviceName();
  json_options.measurements = !options.reproducible;
  std::optional<tg::GaussianModel> start_model;
  if (start_bundle) {
    for (const std::string& warning : start_bundle->warnings) std::fprintf(stderr, "tgtrain: %s\n", warning.c_str());
    start_model = std::move(start_bundle->model);
    start_bundle.reset();
  }
  tg::TrainSettings settings = settingsOf(options);
  if (options.target_bytes > 0) {
    const std::string said =
        planSize(options, tg::trainingPixels(dataset), start_model && tg::isTextured(*start_model), settings);
    if (!options.quiet) std::printf("%s\n", said.c_str());
  }
  planQuantizing(options, settings);
  std::optional<tg::RunState> state;
  if (run) {
    json_options.fingerprint = tg::datasetFingerprint(dataset);
    state = run->begin({dataset, settings, start_model ? &*start_model : nullptr, *renderer, json_options,
                        &stop_requested, quantizedFor(options), context ? &*context : nullptr});
    if (options.run.resume && !state && !options.quiet) {
      std::printf("%s: no checkpoint yet: training starts anew\n", options.run.folder.c_str());
    }
    if (options.watch) tg::startViewer(run->folder(), options.dataset);
  }

  tg::Trainer trainer = state ? tg::Trainer(dataset, settings, *renderer, std::move(*state))
                              : tg::Trainer(dataset, settings, *renderer, std::exchange(start_model, {}));
  state.reset();
  start_model.reset();
  bool storing = false;
  trainer.onQuantizing([&](const tg::GaussianModel& model, float& steps) {
    storing = true;
    if (options.steps > 0) steps = options.steps;
    tg::GaussianModel stored = tg::asStored(options.output, model, options.target_bytes, steps);
    storing = false;
    return stored;
  });
  tg::ProgressLine line;
  tg::Watchers watchers(dataset, run.get(), page.get(), stop_requested,
                        tg::MetricsLog(options.run.metrics_every, options.run.eval_every));
  trainer.onScoring([&](std::size_t done, std::size_t views) {
    if (!options.quiet) line.show("scoring test views", done, views);
    watchers.scoring(trainer, done, views);
  });
  while (!trainer.finished()) {
    watchers.beforeStep(trainer);
    if (stop_requested) break;
    try {
      if (!trainer.step(&stop_requested)) continue;
    } catch (const std::exception&) {
      if (!storing || run) throw;
      // The file cannot be written, which its trial says before the end.
      line.finish();
      json_options.total_seconds = seconds();
      tg::TrainResult result = trainer.result();
      tg::keepModel(options.output, tg::makeTrainedBundle(dataset, settings, result.report, std::move(result.model),
                                                          *renderer, json_options));
      throw;
    }
    if (!options.quiet) line.show(trainer.progress());
    if (run) run->afterStep(trainer);
    watchers.afterStep(trainer);
  }
  line.finish();
  tg::TrainResult result = trainer.result();
  json_options.total_seconds = seconds();

  std::string written;  // what there is to say of the output
  const auto save = [&](const std::string& path, tg::GaussianModel model, const tg::TrainReport& report,
                        tg::SceneSize size = {}) {
    tg::Bundle bundle = tg::makeTrainedBundle(dataset, settings, report, std::move(model), *renderer, json_options);
    const std::string training_json = bundle.training_json;
    const std::string kept = run && path == options.output ? run->model().string() : "";
    const std::string facts = tg::writeScene(path, std::move(bundle), replace, kept, size);
    if (path == options.output) written = facts;
    return training_json;
  };
  const tg::SceneSize size{options.target_bytes, options.steps > 0 ? options.steps : trainer.fileSteps()};
  std::string json;
  if (run) {
    json = run->finish(trainer);
    json_options.total_seconds = run->seconds();
    if (fs::path(options.output).extension() == ".tgz") {
      tg::writeAfterTraining(
          options.output, replace, [&] { tg::copyFileAtomically(run->model(), options.output); },
          [&] { return run->model().string(); });
    } else if (!options.output.empty()) {
      save(options.output, std::move(result.model), result.report, size);
    }
  } else {
    json = save(options.output, std::move(result.model), result.report, size);
  }
  if (!options.untextured_output.empty() && result.untextured) {
    // Of what it went through alone.
    settings.texture_mode = tg::TextureMode::none;
    settings.compare_untextured = false;
    tg::TrainReport report = result.report;
    report.textured.reset();
    save(options.untextured_output, std::move(*result.untextured), report);
  }
  if (!options.json.empty()) {
    const tg::KeepExisting no_other_run(!replace);
    tg::writeTextAtomically(options.json, json);
  }
  if (!options.quiet) {
    const std::string name = options.output.empty() ? run->model().string() : options.output;
    if (written.empty()) written = "(" + std::to_string(fs::file_size(name)) + " bytes)";
    std::fputs(tg::formatSummary(result.report, json_options.total_seconds).c_str(), stdout);
    std::printf("%s%s %s\n", result.report.interrupted ? "interrupted; wrote " : "wrote ", name.c_str(),
                written.c_str());
    if (run && result.report.interrupted) {
      std::printf("the same command with --resume goes on from %s\n", run->checkpoint().c_str());
    }
    std::fflush(stdout);
  }
  watchers.finish(trainer);
  // As a shell reports a program that the signal ended: what comes after `&&` is for finished models.
  // An order to stop is as Ctrl-C.
  const int code = result.report.interrupted ? 128 + (stop_signal > 0 ? stop_signal.load() : SIGINT) : 0;
  if (together) tg::endTogether(*together, code);
  return code;
}

// Every entry of the settings as a flag; what is given stands in `chosen`, over the preset. Switches are flags that
// also take =on and =off.
void addSettingFlags(CLI::App& app, Options& options) {
  const tg::TrainSettings defaults;
  for (const tg::SettingEntry& entry : tg::settingEntries()) {
    const std::string flag = "--" + entry.name;
    const std::string value = entry.get(defaults);
    const bool is_switch = value == "on" || value == "off";
    const std::string help = entry.help + (entry.unit.empty() ? "" : " [" + entry.unit + "]");
    CLI::Option* option = is_switch ? app.add_flag(flag, options.chosen[&entry], help)
                                    : app.add_option(flag, options.chosen[&entry], help)->default_str(value);
    if (!entry.choices.empty()) {
      option->check(tg::oneOf(entry.choices))->type_name("NAME");
    } else if (!is_switch) {
      option->type_name("N");
    }
    option->group("Recipe: numbers and names of --print-config");
  }
}

// Reads a file of settings as ever, and notes which flags stand beside it: it is read after them.
class SettingsFile : public CLI::ConfigTOML {
 public:
  SettingsFile(const CLI::App& app, Options& options) : app_(app), options_(options) {}
  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override {
    options_.from_file = true;
    for (const tg::SettingEntry& entry : tg::settingEntries()) {
      if (app_.count("--" + entry.name) > 0) options_.by_flag.insert(&entry);
    }
    return CLI::ConfigTOML::from_config(input);
  }

 private:
  const CLI::App& app_;
  Options& options_;
};

void addTrainingOptions(CLI::App& app, Options& options) {
  app.add_option("dataset", options.dataset, "Folder: transforms_train.json, transforms.json or COLMAP sparse/0")
      ->type_name("FOLDER");
  app.option_defaults()->group("Model and report");
  app.add_option("-o,--output", options.output,
                 "Model to write, by its extension: " + tg::listed(tg::outputNames(true)) + "; optional with --run")
      ->type_name("FILE");
  tg::addBytes(app, "--target-size", options.target_bytes,
               "Of a .sog or .glb: at most so many bytes, 900KB or 1.5MB; chooses counts that nobody named")
      ->configurable(false);
  app.add_option("--steps", options.steps,
                 "Of a .sog or .glb: so many times as wide are the steps of its numbers (tgconvert --steps)")
      ->check(CLI::Range(tg::kLeastSteps, tg::kMostSteps))
      ->excludes("--target-size")
      ->configurable(false);
  app.add_option("--untextured-output", options.untextured_output,
                 "Write the untextured model too (implies --compare-untextured)")
      ->type_name("FILE");
  app.add_option("--json", options.json, "Also write training.json here")->type_name("FILE");
  app.add_flag("--reproducible", options.reproducible,
               "No times and no memory in training.json: same seed, same bytes");
  app.add_flag("--overwrite", options.overwrite, "Replace existing files");
  app.add_flag("-q,--quiet", options.quiet, "Errors only");
  tg::addDatasetFlags(app, options.data);
  app.option_defaults()->group("Settings");
  app.add_option("--preset", options.preset, "Where settings start from; flags and --config go over it")
      ->check(tg::oneOf(tg::presetNames()))
      ->capture_default_str();
  app.set_config("--config", "", "Settings from a file, as --print-config writes it; flags go over it")
      ->type_name("FILE")
      ->configurable(false);
  app.config_formatter(std::make_shared<SettingsFile>(app, options));
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.add_flag("--print-config", options.print_config, "Print all settings with their units and end")
      ->configurable(false);
  app.add_option(
         "--start-model", options.start_model,
         "Go on from this model (of any format); with --iterations 0, only add textures to it; one with textures goes "
         "on in stage 2")
      ->type_name("FILE");
  app.add_option("--context", options.context,
                 "Draw this model, too, and leave it as it is: a coarse one of the whole scene, around a block of it")
      ->type_name("FILE");
  tg::addDeviceFlag(app, options.device, "Where to train; auto: a CUDA device if there is one");
  app.add_option("--threads", options.threads, "Threads (0: all cores); the model does not depend on it")
      ->check(CLI::Range(0, 4096));
  addSettingFlags(app, options);
}

// A flag that would do nothing is a mistake of whoever typed it.
void refuseIdleFlags(const CLI::App& app, const Options& options) {
  const auto refuse = [&](const char* flag, const char* expected) {
    if (app.count(flag) > 0) throw tg::Error(tg::ErrorKind::usage, std::string(flag) + " expects " + expected);
  };
  if (!options.run.folder.empty()) return;
  for (const char* flag : {"--checkpoint-every", "--preview-every"}) refuse(flag, "a run folder (--run FOLDER)");
  if (!options.serve.empty()) return;
  for (const char* flag : {"--metrics-every", "--eval-every"}) refuse(flag, "--run FOLDER or --serve");
}

// Of the recipe, which files and presets name as a whole: what a flag says and no stage uses is a line on stderr.
void warnIdleSettings(const CLI::App& app, const Options& options) {
  if (options.print_config || options.dataset.empty()) return;
  const tg::TrainSettings settings = settingsOf(options);
  const bool by_adc = settings.densification == tg::Densification::adc;
  const bool textured = settings.texture_mode != tg::TextureMode::none && settings.texture_iterations > 0;
  const auto warn = [&](const std::string& why, const auto& idle) {
    std::string flags;
    for (const tg::SettingEntry& entry : tg::settingEntries()) {
      if (app.count("--" + entry.name) == 0 || !idle(entry)) continue;
      if (options.from_file && !options.by_flag.contains(&entry)) continue;
      flags += (flags.empty() ? "--" : ", --") + entry.name;
    }
    if (!flags.empty()) std::fprintf(stderr, "tgtrain: %s: does nothing with %s\n", flags.c_str(), why.c_str());
  };
  const auto is_of_stage_2 = [](const tg::SettingEntry& entry) {
    const std::string_view name = entry.name;
    const bool is_of_stage = name == "texture-mode" || name == "texture-iterations";
    return !is_of_stage && (name.starts_with("texture-") || name.find("texel") != name.npos);
  };
  const bool planned = options.target_bytes > 0 || !options.start_model.empty();  // what they have of textures
  if (!textured && !planned) {
    const bool none = settings.texture_mode == tg::TextureMode::none;
    warn(none ? "--texture-mode none" : "--texture-iterations 0", is_of_stage_2);
  }
  if (!by_adc) {
    const std::string densification(tg::name(settings.densification));
    warn("--densification " + densification, [](const auto& entry) { return entry.help.starts_with("adc: "); });
  }
  if (settings.densification != tg::Densification::mcmc) {
    const std::string densification(tg::name(settings.densification));
    warn("--densification " + densification, [](const auto& entry) { return entry.help.starts_with("mcmc: "); });
  }
}

void addRunOptions(CLI::App& app, Options& options) {
  const auto add = [&](auto* option) { option->group("Run folder")->configurable(false); };
  const CLI::Range iterations(0, 10'000'000);
  add(app.add_option("--run", options.run.folder,
                     "Folder for checkpoint, model.tgz, metrics.jsonl and previews/ of this run")
          ->type_name("FOLDER"));
  add(app.add_flag("--resume", options.run.resume, "Go on from the run folder's checkpoint, to the same model"));
  add(app.add_option("--checkpoint-every", options.run.checkpoint_seconds,
                     "Time between checkpoints (0: after every step) [s]")
          ->check(CLI::Range(0.0, 1e6))
          ->capture_default_str());
  add(app.add_option("--metrics-every", options.run.metrics_every,
                     "A line of metrics.jsonl and of --serve (0: none) [iterations]")
          ->check(iterations)
          ->capture_default_str());
  add(app.add_option("--eval-every", options.run.eval_every,
                     "Test scores among them (0: at the end of each stage) [iterations]")
          ->check(iterations)
          ->capture_default_str());
  add(app.add_option("--preview-every", options.run.preview_every,
                     "A picture in previews/, truth beside rendering (0: none) [iterations]")
          ->check(iterations)
          ->capture_default_str());
  add(app.add_flag("--watch", options.watch, "Show the run in tgview while it trains"));
  add(app.add_option("--serve", options.serve,
                     "Show the run in browsers, on this machine alone where no address is named")
          ->type_name("[ADDRESS:]PORT"));
  add(app.add_option("--serve-token", options.serve_token,
                     "What the page's address must bring; without one a random one, where others reach it")
          ->type_name("TEXT"));
}

// What a training from photographs depends on beside them.
std::string trainingMadeOf(const Options& options) {
  const tg::DatasetFlags& data = options.data;
  std::string text = tg::formatSettings(settingsOf(options));
  for (const std::string& part :
       {options.start_model, options.context, data.background, data.images, data.points, data.masks, std::to_string(data.downscale),
        std::to_string(data.test_every), std::to_string(data.validation)}) {
    text += part + "\n";
  }
  if (options.target_bytes > 0 || options.steps > 0) {
    for (const auto& [name, value] : quantizedFor(options)) text += name + " " + value + "\n";
  }
  return text;
}

int runPhotos(const tg::PhotosFlags& flags, Options& options) {
  if (options.print_config) return runTraining(options);
  if (options.dataset.empty() || options.output.empty()) {
    throw tg::Error(tg::ErrorKind::usage,
                    "photos: expected a folder of photographs or a film, and -o model.tgz (see tgtrain photos --help)");
  }
  const bool own_run = options.run.folder.empty();
  const tg::PhotosOptions photos =
      tg::photosOptions(flags, options.dataset, options.output, std::max(options.threads, 0));
  if (own_run) options.run.folder = photos.work / "run";
  checkTraining(options);
  std::string ignored;
  if (options.device == "cuda") tg::openCuda(options.device, ignored);
  const std::string made_of = trainingMadeOf(options);
  checkOutputs(options, options.overwrite || tg::isFile(options.run.folder / "checkpoint"));
  if (options.threads > 0) tg::setThreadCount(options.threads);
  tg::checkInput(photos);
  tg::Ledger ledger(photos.work);
  tg::preparePhotosAloud(photos, ledger, options.quiet);

  options.title = nameOf("", options.dataset);
  options.dataset = photos.work.string();
  options.run.resume = !own_run || ledger.isBegun(tg::PhotoStage::training, made_of);
  if (!options.run.resume) {
    checkOutputs(options, options.overwrite);
    std::error_code error;
    fs::remove_all(options.run.folder, error);
    if (error) throw tg::Error(tg::ErrorKind::cannotWrite, options.run.folder.string(), error.message());
    ledger.begin(tg::PhotoStage::training, made_of);
  }
  const int code = runTraining(options);
  if (code != 0 || stop_requested) return code;
  if (!flags.no_open && !options.watch && tg::canShow()) {
    tg::showModel(options.output);
  } else if (!options.quiet) {
    std::printf("tgview %s shows it\n", options.output.c_str());
  }
  return code;
}

std::shared_ptr<CLI::App> photosApp(Options& options, tg::PhotosFlags& flags) {
  auto app = std::make_shared<CLI::App>(
      "Finds the cameras of photographs or of a film by COLMAP, trains a model and opens it.", "photos");
  addTrainingOptions(*app, options);
  app->get_option("dataset")->description("Folder of photographs (JPEG, PNG, WebP, HEIC), or a film");
  addRunOptions(*app, options);
  tg::addPhotosFlags(*app, flags);
  tg::addExamples(*app, {{"tgtrain photos jpegs -o model.tgz", "a folder of photographs"},
                         {"tgtrain photos walk.mp4 -o model.tgz", "a film"},
                         {"tgtrain photos walk.mp4 -o model.tgz --frames 200", "more frames of it"},
                         {"tgtrain photos jpegs -o model.tgz --preset quick", "soon, and worse"},
                         {"tgtrain photos jpegs -o scene.sog --target-size 2MB", "a file to ship"},
                         {"tgtrain photos jpegs -o model.tgz --no-open", "without a window at the end"}});
  return app;
}

void addSampleOptions(CLI::App& app, std::string& folder, tg::SampleOptions& options, bool& overwrite, bool& quiet) {
  app.add_option("folder", folder, "Folder to write")->required()->type_name("FOLDER");
  app.add_option("--size", options.size, "Side of the images in pixels")->capture_default_str();
  app.add_option("--views", options.train_views, "Training views")->capture_default_str();
  app.add_option("--test-views", options.test_views, "Test views")->capture_default_str();
  app.add_option("--points", options.points, "Points in points3d.ply")->capture_default_str();
  app.add_option("--supersampling", options.supersampling, "Rays per pixel and axis")->capture_default_str();
  app.add_option("--grid", options.grid, "Grow it to so many cells a side, which share views and points")
      ->capture_default_str();
  app.add_flag("--overwrite", overwrite, "Replace an existing data set");
  app.add_flag("-q,--quiet", quiet, "Errors only");
  tg::addExamples(app, {{"tgtrain make-sample scene", "the built-in scene"},
                        {"tgtrain make-sample scene --size 400 --views 60", "larger, and seen from more places"},
                        {"tgtrain make-sample scene --overwrite", "anew"},
                        {"tgtrain make-sample tiny --size 32 --views 4 --test-views 2", "for a test of a second"},
                        {"tgtrain make-sample scene && tgtrain scene -o model.tgz", "and train it"}});
}

// The same flags as training, so that the same photographs come out; transparency is kept.
struct UndistortOptions {
  std::string data;
  std::string folder;
  tg::DatasetFlags dataset;
  bool overwrite = false;
  bool quiet = false;
};
void addUndistortOptions(CLI::App& app, UndistortOptions& options) {
  app.add_option("dataset", options.data, "Data set to read")->required()->type_name("FOLDER");
  app.add_option("folder", options.folder, "Folder to write")->required()->type_name("FOLDER");
  app.add_flag("--overwrite", options.overwrite, "Replace an existing data set");
  app.add_flag("-q,--quiet", options.quiet, "Errors only");
  tg::addDatasetFlags(app, options.dataset);
  tg::addExamples(app, {{"tgtrain undistort fox straight", "photographs of pinhole cameras"},
                        {"tgtrain undistort fox straight --downscale 2", "at half the size"},
                        {"tgtrain undistort truck straight --layout colmap", "of a folder that holds several layouts"},
                        {"tgtrain undistort fox straight --overwrite", "anew"},
                        {"tgview model.tgz --photos straight", "to compare a model with"}});
}
int undistort(const UndistortOptions& options) {
  tg::DatasetOptions dataset_options = tg::datasetOptions(options.dataset);
  if (!dataset_options.background) dataset_options.random_background = true;
  const tg::Dataset dataset = tg::loadDataset(options.data, dataset_options);
  tg::printNotes(options.data, dataset);
  tg::writeDataset(options.folder, dataset, options.overwrite);
  if (!options.quiet) std::printf("wrote %zu photographs to %s\n", dataset.views.size(), options.folder.c_str());
  return 0;
}

int runCommand(int argc, char** argv, std::unique_ptr<tg::Processes>& together) {
  Options photos_options;
  tg::PhotosFlags photos_flags;
  const std::shared_ptr<CLI::App> photos = photosApp(photos_options, photos_flags);
  // By itself: CLI11 reads --config for no subcommand.
  if (argc > 1 && std::string_view(argv[1]) == "photos" && !tg::launchOf().together()) {
    photos->name("tgtrain photos");
    if (const std::optional<int> code = tg::parseCommandLine(*photos, argc - 1, argv + 1)) return *code;
    std::error_code ignored;
    if (photos->count("--frames") > 0 && fs::is_directory(photos_options.dataset, ignored)) {
      throw tg::Error(tg::ErrorKind::usage, "--frames expects a film (" + photos_options.dataset + " is a folder)");
    }
    warnIdleSettings(*photos, photos_options);
    return runPhotos(photos_flags, photos_options);
  }
  CLI::App app("Trains a textured Gaussian model from photographs with known cameras.", "tgtrain");
  app.require_subcommand(0, 1);
  Options options;
  addTrainingOptions(app, options);
  addRunOptions(app, options);
  app.option_defaults()->group("Options");
  tg::addExamples(app,
                  {{"tgtrain make-sample scene && tgtrain scene -o model.tgz", "the built-in scene"},
                   {"tgtrain fox -o fox.tgz --downscale 2", "photographs at half their size"},
                   {"tgtrain fox --run run --watch", "a run that can stop and go on, in a window"},
                   {"tgtrain fox -o fox.tgz --serve 8080", "in a browser meanwhile"},
                   {"tgtrain fox --run run --resume", "go on where it stopped"},
                   {"mpirun -np 4 tgtrain fox -o fox.tgz", "by four processes, to the same bytes"},
                   {"tgtrain fox -o fox.sog --target-size 900KB", "a file to ship, of at most that size"},
                   {"tgtrain fox -o fox.tgz --iterations 0 --start-model scan.ply", "only add textures"},
                   {"tgtrain --preset quick --print-config > quick.toml", "settings to change by hand"}},
                  "Interrupted (Ctrl-C, kill) it writes the model so far, and exits with 128 +\n"
                  "the signal's number.");
  tg::SampleOptions sample_options;
  std::string sample_folder;
  bool sample_overwrite = false, sample_quiet = false;
  CLI::App* sample = app.add_subcommand("make-sample", "Writes the built-in scene as a NeRF-synthetic data set");
  addSampleOptions(*sample, sample_folder, sample_options, sample_overwrite, sample_quiet);
  app.add_subcommand(photos);
  UndistortOptions undistort_options;
  CLI::App* undistorted = app.add_subcommand(
      "undistort", "Writes a data set as training sees it: photographs of pinhole cameras, in nerfstudio's layout");
  addUndistortOptions(*undistorted, undistort_options);
  tg::PlotOptions plot_options;
  CLI::App* plotted = app.add_subcommand("plot", "Draws the curves of runs: loss, PSNR and Gaussians");
  tg::addPlotOptions(*plotted, plot_options);
  tg::FarmFlags farm_flags;
  CLI::App* farm = app.add_subcommand("farm", "Works on a list of trainings beside other workers, on many machines");
  tg::addFarmFlags(*farm, farm_flags);
  tg::SplitFlags split_flags;
  CLI::App* split = app.add_subcommand("split", "Cuts a scene into blocks, each a data set of its own");
  tg::addSplitFlags(*split, split_flags);
  std::vector<std::string> commands;
  for (const CLI::App* command : app.get_subcommands({})) commands.push_back(command->get_name());
  together = tg::joinProcesses(argc, argv, commands);
  const std::optional<int> parsed = tg::parseTogether(together.get(), [&] {
    const std::optional<int> code = tg::parseCommandLine(app, argc, argv);
    if (!code && app.get_subcommands().empty()) {
      refuseIdleFlags(app, options);
      if (!together || together->isFirst()) warnIdleSettings(app, options);
    }
    return code;
  });
  if (parsed) return *parsed;
  if (*sample) {
    tg::writeSample(sample_folder, sample_options, sample_overwrite);
    if (!sample_quiet) {
      const int views = sample_options.train_views + sample_options.test_views;
      std::printf("wrote %d photographs to %s\n", views, sample_folder.c_str());
    }
    return 0;
  }
  if (*photos) throw tg::Error(tg::ErrorKind::usage, "photos: expected before every flag (tgtrain photos FOLDER ...)");
  if (*undistorted) return undistort(undistort_options);
  if (*plotted) {
    tg::plotRuns(plot_options);
    return 0;
  }
  if (*farm) return tg::runFarm(farm_flags);
  if (*split) {
    tg::splitScene(split_flags);
    return 0;
  }
  return runTraining(options, together.get());
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);  // who reads a pipe reads each line when it is said
  std::unique_ptr<tg::Processes> together;  // where mpirun has started several
  const int code = tg::runProgram("tgtrain", [&] {
    try {
      return runCommand(argc, argv, together);
    } catch (const tg::EndedByFirst& ended) {
      return ended.code;
    }
  });
  if (together) together->leave(code);
  return code;
}
