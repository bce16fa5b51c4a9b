// SPDX-License-Identifier: Apache-2.0
// Checks what can be checked first, trains, and writes what came of it.
#include "training/train.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <string_view>
#include <utility>

#include "converter/gltf/write_gltf.h"
#include "converter/registry/file_format.h"
#include "core/file/atomic_files.h"
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
#include "training/photos/scan.h"
#include "training/run/report.h"
#include "training/run/size_plan.h"
#include "training/run/trained_bundle.h"
#include "training/run/trainer.h"
#include "training/settings/schedule.h"
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

// Whether a flag says it, or a file of settings, which names them all, other than the preset.
template <typename Named>
bool given(const TrainFlags& options, const TrainSettings& settings, const Named& named) {
  const TrainSettings preset = presetSettings(options.preset);
  return std::ranges::any_of(options.chosen, [&](const auto& setting) {
    const SettingEntry& entry = *setting.first;
    const bool by_flag = options.settings_file.empty() || options.by_flag.contains(&entry);
    const bool chosen = !setting.second.empty() && (by_flag || entry.get(settings) != entry.get(preset));
    return chosen && named(std::string_view(entry.name));
  });
}

// A plain start model is drawn as it was trained, unless a flag names another intersection.
void followStart(const TrainFlags& options, const GaussianModel* start, TrainSettings& settings) {
  if (!start || isTextured(*start)) return;
  if (!given(options, settings, [](std::string_view name) { return name == "intersection"; })) {
    settings.intersection = start->intersection;
  }
}

// What nobody chose, so that the output has room for it, by what is best at equal bytes (docs/frontier.md,
// docs/lab/quality.md): SH degree 1, and no textures where neither a flag nor the start model speaks of them; where one
// does, textures that Gaussians share, if these can be trained (`shares`). A start model keeps its SH degree, one with
// textures its Gaussians and their texels. Returns what to say of it.
std::string planSize(const TrainFlags& options, std::uint64_t training_pixels, const GaussianModel* start, bool shares,
                     TrainSettings& settings) {
  const auto given = [&](const auto& named) { return tg::given(options, settings, named); };
  const auto is = [](std::initializer_list<std::string_view> names) {
    return [names](std::string_view name) { return std::ranges::find(names, name) != names.end(); };
  };
  const bool speaks_of_textures = settings.compare_untextured || given([](std::string_view name) {
                                    return name.find("texture") != name.npos || name.find("texel") != name.npos;
                                  });
  const bool counted = given(is({"gaussians", "percent"})),
             sized = given(is({"texture-size"})) && settings.texture_size > 0;
  const bool dealt_out = given(is({"adaptive-texels", "texel-budget"}));
  const bool timed = given(is({"iterations", "densify-until"}));
  const bool textured_start = start && isTextured(*start);
  if (!given(is({"sh-degree"}))) settings.sh_degree = start ? start->sh_degree : kPlannedShDegree;
  const double part = partOfSog(options.output);
  const bool unasked =
      !speaks_of_textures || settings.texture_mode == TextureMode::none || settings.texture_iterations == 0;
  bool plain = unasked && !textured_start && (settings.iterations > 0 || settings.texture_iterations == 0);
  bool too_small = false;  // for textures: more Gaussians show more
  if (!plain && settings.texture_mode != TextureMode::none && shares && !textured_start && !dealt_out &&
      !given(is({"texture-dictionary", "texture-sizes"}))) {
    const int side = sized ? settings.texture_size : kPlannedTextureSize;
    settings.texture_dictionary = planSharedTextures(options.target_bytes, part, side);
    too_small = settings.texture_dictionary == 0 && settings.iterations > 0 && !settings.compare_untextured && !sized;
    plain = too_small;
  }
  if (plain) {
    settings.texture_mode = TextureMode::none;
    if (!timed || too_small) {
      settings.densify_until = makeSchedule(settings).densify_until;  // what is longer is for what stands
      settings.iterations += settings.texture_iterations;
    }
  }
  const bool textured = settings.texture_mode != TextureMode::none;
  const bool dictionary = textured && settings.texture_dictionary > 0;
  if (dictionary && !textured_start && !sized) settings.texture_size = kPlannedTextureSize;
  const SizePlan plan =
      dictionary ? planForDictionary(options.target_bytes, part, settings.sh_degree, settings.texture_dictionary,
                                     std::max(settings.texture_size, 1))
                 : planForSize(options.target_bytes, part, training_pixels, settings.sh_degree, settings.texture_mode);
  const bool planned = !textured_start && !counted, cut = textured && !textured_start && !dealt_out && !dictionary;
  if (planned) settings.gaussians = plan.gaussians;
  if (cut) {
    settings.adaptive_texels = static_cast<float>(plan.texels);
    if (!sized) settings.texture_size = kPlannedTextureSize;
  }
  checkSettings(settings);
  std::string said =
      formatted("planned for %ju bytes: SH degree %d", std::uintmax_t{options.target_bytes}, settings.sh_degree);
  if (planned) said += formatted(", %zu Gaussians", settings.gaussians);
  if (counted && !textured_start && settings.percent == 0 && settings.gaussians > plan.gaussians) {
    said += formatted(", %zu Gaussians, whose numbers will be coarser than those of the %zu it has room for",
                      settings.gaussians, plan.gaussians);
  }
  const bool merges = settings.iterations > 0 && makeSchedule(settings).merge_after > 0;
  const std::size_t grown = grownLimit(settings.gaussians, training_pixels);
  if (planned && merges && grown > settings.gaussians) {
    said += formatted(" (up to %zu until pairs are merged)", grown);
  }
  if (cut) said += formatted(", %.1f texels each", plan.texels);
  if (dictionary) said += formatted(", %d textures that they share", settings.texture_dictionary);
  if (too_small) {
    said += formatted(
        ", no textures, for which so small a file has no room (--adaptive-texels N asks for them): %d iterations",
        settings.iterations);
  }
  return said;
}

// For a file of coarser numbers, where nobody said how long: as long as it pays (docs/lab/quality.md).
constexpr int kQuantizedShare = 10;  // of the iterations of the other stages
void planQuantizing(const TrainFlags& options, const GaussianModel* start, TrainSettings& settings) {
  const bool coarse = options.target_bytes > 0 || options.steps > 0;
  if (settings.quantize_iterations > 0 && !coarse) {
    throw Error(ErrorKind::usage,
                "--quantize-iterations is for a file of coarser numbers (expected --target-size or --steps)");
  }
  const auto says = [](std::string_view name) { return name == "quantize-iterations"; };
  const auto degree = [](std::string_view name) { return name == "sh-degree"; };
  if (options.steps > 0 && start && !given(options, settings, degree)) settings.sh_degree = start->sh_degree;
  if (!coarse || settings.compare_untextured || given(options, settings, says)) return;
  const bool textured = settings.texture_mode != TextureMode::none;
  const int plain = start && isTextured(*start) ? 0 : settings.iterations;
  const int others = plain + (textured ? settings.texture_iterations : 0);
  if (others > 0) settings.quantize_iterations = std::max(others / kQuantizedShare, kLeastQuantizeIterations);
}

std::unique_ptr<RunFolder> openRunFolder(const TrainFlags& options) {
  if (options.run.folder.empty()) return nullptr;
  RunFolderOptions folder = options.run;
  folder.overwrite = options.overwrite;
  return std::make_unique<RunFolder>(folder);
}

// After it was not written: what is there is another's. The error that says why is what matters.
void disown(const RunFolder& run, const fs::path& file) {
  try {
    run.setOwn(file, false);
  } catch (const Error&) {
  }
}

Dataset loadData(const TrainFlags& options, DatasetOptions data_options) {
  ProgressLine line;
  if (!options.quiet) {
    data_options.decoded = [&](std::size_t done, std::size_t count) { line.show("decoding photographs", done, count); };
  }
  Dataset dataset = loadDataset(options.dataset, data_options);
  const Camera& camera = dataset.views.front();
  printNotes(options.dataset, dataset);
  if (!options.quiet) {
    const std::size_t count = dataset.points.position.size();
    const std::string points = count > 0                     ? std::to_string(count) + " points"
                               : options.start_model.empty() ? "no points: random ones are the start"
                                                             : "no points";
    std::printf("%s: %zu train and %zu test views of %d x %d (%s), %s\n", dataset.name.c_str(),
                dataset.indices(false).size(), dataset.indices(true).size(), camera.size.x, camera.size.y,
                std::string(name(dataset.layout)).c_str(), points.c_str());
    std::fflush(stdout);
  }
  return dataset;
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

}  // namespace

void checkOutputs(const TrainFlags& options, bool resumes) {
  const std::vector<std::string> paths = {options.output, options.untextured_output, options.json};
  const auto placeOf = [](const fs::path& path) {
    std::error_code ignored;
    const fs::path absolute = fs::absolute(path), place = fs::weakly_canonical(absolute, ignored);
    return place.empty() ? absolute.lexically_normal() : place;
  };
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const std::string& path = paths[i];
    if (path.empty()) continue;
    const Format* format = &path == &paths.back() ? nullptr : &modelFormat(path);
    for (std::size_t j = 0; j < i; ++j) {
      if (!paths[j].empty() && placeOf(path) == placeOf(paths[j])) {
        throw Error(ErrorKind::usage, path, "is named for two outputs (expected different files)");
      }
    }
    const fs::path& run = options.run.folder;
    for (const std::string& input : {options.start_model, options.context}) {  // which --resume would read again
      if (run.empty() || input.empty() || placeOf(path) != placeOf(input)) continue;
      throw Error(ErrorKind::usage, path, "is what training starts from (expected another name with a run folder)");
    }
    for (const char* own :
         {"model.tgz", "checkpoint", "metrics.jsonl", "outputs.json", "live.tgz", "live.json", "control", "previews"}) {
      if (run.empty() || placeOf(path) != placeOf(run / own)) continue;
      throw Error(ErrorKind::usage, path, "is written in any case, by the run folder (expected another name)");
    }
    refuseExisting(path, options.overwrite || (resumes && isOutputOf(run, path)));
    if (format) {
      requireWritable(*format, path);
    } else {
      requireWritable(path);
    }
  }
}

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
  if (!options.context.empty() && !isFile(options.context)) {
    throw Error(ErrorKind::cannotRead, options.context, "no such file");
  }
  std::optional<Bundle> start = startModel(options);
  const GaussianModel* model = start ? &start->model : nullptr;
  followStart(options, model, settings);
  if (options.target_bytes > 0) planSize(options, 0, model, !together, settings);
  planQuantizing(options, model, settings);
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
  if (options.target_bytes > 0 || options.steps > 0) {
    for (const auto& [name, value] : quantizedFor(options)) text += name + " " + value + "\n";
  }
  return text;
}

void checkData(const TrainFlags& options) {
  const Dataset dataset = loadDataset(options.dataset, datasetOptions(options.data));
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
  const auto data_options = [&] {
    DatasetOptions data = datasetOptions(options.data);
    if (together) takeShare(*together, options.threads, options.data.image_memory == 0, data);
    return data;
  };
  if (together && !together->isFirst()) return followFirst(*together, options.dataset, data_options);

  const auto seconds = [start = std::chrono::steady_clock::now()] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  std::signal(SIGPIPE, SIG_IGN);  // as handleStopSignals() has it, for what is said before
  std::optional<Bundle> start_bundle;
  std::unique_ptr<PageServer> page;
  std::unique_ptr<RunFolder> run;
  std::string why_cpu;
  std::unique_ptr<DifferentiableRenderer> renderer;
  Dataset dataset;
  const auto load = [&] {
    const bool no_output = options.output.empty() && options.run.folder.empty();
    if (options.dataset.empty() || no_output) {
      const std::string output = "-o model.tgz or --run FOLDER (see --help)";
      throw Error(ErrorKind::usage, !no_output                ? "expected a data set (see --help)"
                                    : options.dataset.empty() ? "expected a data set and " + output
                                                              : options.dataset + ": expected " + output);
    }
    if (options.data.layout == "auto" && isForPhotos(options.dataset)) {
      const std::string near = isFile(options.dataset) ? "" : datasetNear(options.dataset);
      if (!near.empty()) {
        throw Error(ErrorKind::badData, options.dataset, "not a data set" + near);
      }
      throw Error(ErrorKind::badData, options.dataset,
                  (isFile(options.dataset) ? "is a film" : "not a data set, but photographs without cameras") +
                      std::string(": `tgtrain photos ") + shellWord(options.dataset) +
                      " -o model.tgz` finds the cameras and trains");
    }
    if (together) refuseTogether(options);
    start_bundle = checkTraining(options, together != nullptr);
    if (!options.serve.empty()) {
      page = servePage(options.serve, options.serve_token, nameOf(options.title, options.dataset),
                       {options.dataset, options.run.folder});
    }
    run = openRunFolder(options);
    checkOutputs(options, run && run->hasCheckpoint());
    if (!together) renderer = openCuda(options.device, why_cpu);
    dataset = loadData(options, data_options());
  };
  if (together) {
    beginTogether(*together, load, dataset);
    renderer = makeShardedRenderer(together->channel(), dataset);
  } else {
    load();
  }
  if (!renderer) renderer = makeCpuDifferentiableRenderer();
  const std::optional<GaussianModel> context = contextOf(options, dataset);
  if (context) renderer = withContext(std::move(renderer), *context);
  if (!why_cpu.empty() && !options.quiet) std::printf("training on the CPU (%s)\n", why_cpu.c_str());
  handleStopSignals(requestStop);
  TrainingJsonOptions json_options;
  json_options.downscale = options.data.downscale;
  json_options.threads = threadCount();
  json_options.device = renderer->deviceName();
  json_options.measurements = !options.reproducible;
  std::optional<GaussianModel> start_model;
  if (start_bundle) {
    if (!options.quiet) {
      for (const std::string& warning : start_bundle->warnings) std::fprintf(stderr, "tgtrain: %s\n", warning.c_str());
    }
    start_model = std::move(start_bundle->model);
    if (isTextured(*start_model)) {  // which is past stage 1
      warnIdle(options, "a start model that has textures", [&](const SettingEntry& entry) {
        return (entry.name == "iterations" && settingsOf(options).iterations > 0) || entry.name.starts_with("densif");
      });
    }
    start_bundle.reset();
  }
  TrainSettings settings = settingsOf(options);
  followStart(options, start_model ? &*start_model : nullptr, settings);
  if (options.target_bytes > 0) {
    const std::string said =
        planSize(options, trainingPixels(dataset), start_model ? &*start_model : nullptr, !together, settings);
    if (!options.quiet) std::printf("%s\n", said.c_str());
  }
  planQuantizing(options, start_model ? &*start_model : nullptr, settings);
  std::optional<RunState> state;
  if (run) {
    json_options.fingerprint = datasetFingerprint(dataset);
    state = run->begin({dataset, settings, start_model ? &*start_model : nullptr, json_options, &stop_requested,
                        quantizedFor(options), context ? &*context : nullptr});
    const float steps = state ? state->file_steps : 0;
    if (steps != 0 && !(steps >= kLeastSteps && steps <= kMostSteps)) {
      throw Error(ErrorKind::badData, run->checkpoint().string(),
                  "file_steps: expected " + numberText(kLeastSteps) + " to " + numberText(kMostSteps) + ", found " +
                      numberText(steps));
    }
    if (options.run.resume && !state && !options.quiet) {
      std::printf("%s: no checkpoint yet: training starts anew\n", options.run.folder.c_str());
    }
    if (options.watch) startViewer(run->folder(), options.dataset);
  }

  Trainer trainer = state ? Trainer(dataset, settings, *renderer, std::move(*state))
                          : Trainer(dataset, settings, *renderer, std::exchange(start_model, {}));
  state.reset();
  start_model.reset();
  bool storing = false;
  trainer.onQuantizing([&](const GaussianModel& model, float& steps) {
    storing = true;
    if (options.steps > 0) steps = options.steps;
    GaussianModel stored = asStored(options.output, model, options.target_bytes, steps);
    storing = false;
    return stored;
  });
  ProgressLine line;
  Watchers watchers(dataset, run.get(), page.get(), stop_requested,
                    MetricsLog(options.run.metrics_every, options.run.eval_every));
  trainer.onScoring([&](std::size_t done, std::size_t views) {
    if (!options.quiet) line.show("scoring test views", done, views);
    watchers.scoring(trainer, done, views);
  });
  while (!trainer.finished()) {
    watchers.beforeStep(trainer);
    if (stop_requested) break;
    try {
      if (!trainer.step(&stop_requested)) continue;
    } catch (const std::exception& error) {
      // The file cannot be written, which its trial says before the end, or textures have no room.
      const auto* named = dynamic_cast<const Error*>(&error);
      const bool no_memory = dynamic_cast<const std::bad_alloc*>(&error) != nullptr;
      if (run || !(storing || named || no_memory)) throw;
      const Error why = named       ? *named
                        : no_memory ? Error(ErrorKind::device, "out of memory")
                                    : Error(ErrorKind::cannotWrite, options.output, error.what());
      std::optional<Bundle> bundle;
      try {
        std::optional<TrainResult> kept = storing ? trainer.result() : trainer.takePlain();
        line.finish();
        json_options.total_seconds = seconds();
        if (kept) bundle = makeTrainedBundle(dataset, settings, kept->report, std::move(kept->model), json_options);
      } catch (const std::exception&) {
        // The first reason says more.
      }
      if (!bundle) throw why;
      throw keepModel(options.output, *std::move(bundle), why);
    }
    if (!options.quiet) line.show(trainer.progress());
    if (run) run->afterStep(trainer);
    watchers.afterStep(trainer);
  }
  line.finish();
  TrainResult result = trainer.result();
  json_options.total_seconds = seconds();

  // Calls write(replace) for an output. What a run wrote when it was stopped, it replaces when it goes on.
  const auto writeOutput = [&](const std::string& path, const auto& write) {
    const bool replace = options.overwrite || (run && run->owns(path));
    std::error_code ignored;
    if (run && (replace || !fs::exists(path, ignored))) run->setOwn(path, true);
    try {
      write(replace);
    } catch (const Error&) {
      if (run && !replace) disown(*run, path);
      throw;
    }
  };
  std::string written;  // what there is to say of the output
  bool too_large = false;
  const auto save = [&](const std::string& path, GaussianModel model, const TrainReport& report, SceneSize size = {}) {
    Bundle bundle = makeTrainedBundle(dataset, settings, report, std::move(model), json_options);
    const std::string training_json = bundle.training_json;
    const std::string kept = run && path == options.output ? run->model().string() : "";
    writeOutput(path, [&](bool replace) {
      try {
        const std::string facts = writeScene(path, std::move(bundle), replace, kept, options.quiet, size);
        if (path == options.output) written = facts;
      } catch (const Error& error) {
        // What a training was stopped at may be larger than what would have come of it.
        if (!report.interrupted || size.bytes == 0 || error.kind != ErrorKind::usage) throw;
        std::fprintf(stderr, "tgtrain: %s\n", error.what());
        if (run && !replace) disown(*run, path);
        too_large = true;
      }
    });
    return training_json;
  };
  const SceneSize size{options.target_bytes, options.steps > 0 ? options.steps : trainer.fileSteps()};
  std::string json;
  if (run) {
    json = run->finish(trainer);
    json_options.total_seconds = run->seconds();
    if (!options.output.empty() && outputFormat(options.output).name == "tgz") {
      writeOutput(options.output, [&](bool replace) {
        writeAfterTraining(
            options.output, replace, [&] { copyFileAtomically(run->model(), options.output); },
            [&] { return run->model().string(); });
      });
    } else if (!options.output.empty()) {
      save(options.output, std::move(result.model), result.report, size);
    }
  } else {
    json = save(options.output, std::move(result.model), result.report, size);
  }
  if (!options.untextured_output.empty() && result.untextured) {
    // Of what it went through alone.
    settings.texture_mode = TextureMode::none;
    settings.compare_untextured = false;
    TrainReport report = result.report;
    report.textured.reset();
    save(options.untextured_output, std::move(*result.untextured), report);
  }
  if (!options.json.empty()) {
    writeOutput(options.json, [&](bool replace) {
      const KeepExisting no_other_run(!replace);
      writeTextAtomically(options.json, json);
    });
  }
  if (!options.quiet) {
    const std::string name = options.output.empty() ? run->model().string() : options.output;
    std::fputs(formatSummary(result.report, json_options.total_seconds).c_str(), stdout);
    if (too_large) {
      std::printf("interrupted; %s is not written\n", name.c_str());
    } else {
      if (written.empty()) written = "(" + std::to_string(fs::file_size(name)) + " bytes)";
      std::printf("%s%s %s\n", result.report.interrupted ? "interrupted; wrote " : "wrote ", name.c_str(),
                  written.c_str());
    }
    if (!options.untextured_output.empty() && result.untextured) {
      std::printf("wrote %s, without textures\n", options.untextured_output.c_str());
    }
    if (run && result.report.interrupted) {
      std::printf("the same command with --resume goes on from %s\n", run->checkpoint().c_str());
    }
    std::fflush(stdout);
  }
  watchers.finish(trainer);
  // As a shell reports a program that the signal ended: what comes after `&&` is for finished models.
  // An order to stop is as Ctrl-C.
  const int code = result.report.interrupted ? 128 + (stop_signal > 0 ? stop_signal.load() : SIGINT) : 0;
  if (together) endTogether(*together, code);
  return code;
}

bool stopRequested() { return stop_requested; }

}  // namespace tg
