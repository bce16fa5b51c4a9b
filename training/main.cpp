// SPDX-License-Identifier: Apache-2.0
// tgtrain: flags to settings, signals to a clean end, errors to exit codes.
#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <map>
#include <span>

#include "core/bundle.h"
#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"
#include "training/cli.h"
#include "training/report.h"
#include "training/sample.h"
#include "training/trainer.h"

namespace {

namespace fs = std::filesystem;

constexpr int kPreviewSide = 512;  // [px]

std::atomic<bool> stop_requested{false};

// The first Ctrl-C ends training after the current step and writes the model; the second ends the program at once.
void requestStop(int signal) {
  stop_requested = true;
  std::signal(signal, SIG_DFL);
}

struct Options {
  std::string dataset;
  std::string output;
  std::string untextured_output;
  std::string json;
  tg::DatasetFlags data;
  std::string preset = "default";
  std::map<const tg::SettingEntry*, std::string> chosen;  // over the preset; empty: not given
  int threads = 0;
  bool overwrite = false;
  bool quiet = false;
  bool reproducible = false;
  bool print_config = false;
};

// Before hours of training: what could not be written at their end.
void checkOutputs(const Options& options) {
  const std::vector<std::string> paths = {options.output, options.untextured_output, options.json};
  for (std::size_t i = 0; i < paths.size(); i++) {
    const std::string& path = paths[i];
    if (path.empty()) continue;
    const bool model = &path != &paths.back();
    if (model && fs::path(path).extension() != ".tgz") {
      throw tg::Error(tg::ErrorKind::usage, path,
                      "unknown model format (expected .tgz, found \"" + fs::path(path).extension().string() + "\")");
    }
    for (std::size_t j = 0; j < i; j++) {
      if (fs::path(path).lexically_normal() == fs::path(paths[j]).lexically_normal()) {
        throw tg::Error(tg::ErrorKind::usage, path, "is named for two outputs (expected different files)");
      }
    }
    tg::refuseExisting(path, options.overwrite);
    tg::requireWritable(path);
  }
}

tg::Image previewOf(const tg::Dataset& dataset, const tg::GaussianModel& model, tg::DifferentiableRenderer& renderer) {
  const std::vector<std::size_t> test = dataset.indices(true);
  tg::Camera camera = dataset.views[test.empty() ? 0 : test.front()].camera;
  const int side = std::max(camera.width, camera.height);
  if (side > kPreviewSide) {
    camera = tg::resized(camera, std::max(1, camera.width * kPreviewSide / side),
                         std::max(1, camera.height * kPreviewSide / side));
  }
  return tg::renderPicture(renderer, model, camera, dataset.background);
}

tg::TrainSettings settingsOf(const Options& options) {
  tg::TrainSettings settings = tg::presetSettings(options.preset);
  for (const auto& [entry, value] : options.chosen) {
    if (!value.empty()) entry->set(settings, value == "true" ? "on" : value == "false" ? "off" : value);
  }
  settings.compare_untextured |= !options.untextured_output.empty();
  tg::checkSettings(settings);
  return settings;
}

int runTraining(const Options& options) {
  if (options.print_config) {
    std::fputs(tg::formatSettings(settingsOf(options)).c_str(), stdout);
    return 0;
  }
  if (options.dataset.empty() || options.output.empty()) {
    throw tg::Error(tg::ErrorKind::usage, "expected a data set and -o model.tgz (see --help)");
  }
  const tg::TrainSettings settings = settingsOf(options);
  checkOutputs(options);
  if (options.threads > 0) tg::setThreadCount(options.threads);

  const auto start = std::chrono::steady_clock::now();
  const tg::Dataset dataset = tg::loadDataset(options.dataset, tg::datasetOptions(options.data));
  const tg::Camera& camera = dataset.views.front().camera;
  if (dataset.missing_images > 0) {
    std::fprintf(stderr, "%s: %d listed images are missing and were skipped\n", options.dataset.c_str(),
                 dataset.missing_images);
  }
  if (!options.quiet) {
    std::printf("%s: %zu train and %zu test views of %d x %d (%s), %zu points\n", dataset.name.c_str(),
                dataset.indices(false).size(), dataset.indices(true).size(), camera.width, camera.height,
                std::string(tg::name(dataset.layout)).c_str(), dataset.points.position.size());
    std::fflush(stdout);
  }

  std::signal(SIGINT, requestStop);
  std::signal(SIGTERM, requestStop);
  tg::ProgressLine line;
  tg::TrainHooks hooks;
  hooks.stop = &stop_requested;
  if (!options.quiet) hooks.after_step = [&](const tg::Trainer& trainer) { line.show(trainer.progress()); };
  const auto renderer = tg::makeCpuDifferentiableRenderer();
  tg::TrainResult result = tg::train(dataset, settings, *renderer, hooks);
  line.finish();

  tg::TrainingJsonOptions json_options;
  json_options.downscale = options.data.downscale;
  json_options.threads = tg::threadCount();
  json_options.total_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  json_options.measurements = !options.reproducible;

  const auto save = [&](const std::string& path, tg::GaussianModel model) {
    tg::Bundle bundle;
    bundle.preview = previewOf(dataset, model, *renderer);
    bundle.model = std::move(model);
    bundle.background = dataset.background;
    for (const tg::View& view : dataset.views) bundle.cameras.push_back(view.camera);
    bundle.training_json = tg::formatTrainingJson(dataset, settings, result.report, bundle.model, json_options);
    tg::writeBundle(path, bundle);
    return bundle.training_json;
  };
  const std::string json = save(options.output, std::move(result.model));
  if (!options.untextured_output.empty() && result.untextured) {
    save(options.untextured_output, std::move(*result.untextured));
  }
  if (!options.json.empty()) {
    tg::writeFileAtomically(options.json, std::span(reinterpret_cast<const std::uint8_t*>(json.data()), json.size()));
  }
  if (!options.quiet) {
    std::fputs(tg::formatSummary(result.report, json_options.total_seconds).c_str(), stdout);
    std::printf("%s%s (%ju bytes)\n", result.report.interrupted ? "interrupted; wrote " : "wrote ",
                options.output.c_str(), static_cast<std::uintmax_t>(fs::file_size(options.output)));
  }
  return 0;
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
    CLI::Option* option = is_switch
                              ? app.add_flag(flag, options.chosen[&entry], help)
                              : app.add_option(flag, options.chosen[&entry], help)->default_str(value)->type_name("");
    option->group("Recipe");
  }
}

void addTrainingOptions(CLI::App& app, Options& options) {
  app.add_option("dataset", options.dataset, "Folder: transforms_train.json, transforms.json or COLMAP sparse/0");
  app.add_option("-o,--output", options.output, "Model to write (.tgz)");
  app.add_option("--preset", options.preset, "Where settings start from; flags and --config go over it")
      ->check(CLI::IsMember(tg::presetNames()))
      ->capture_default_str();
  app.set_config("--config", "", "Settings from a file, as --print-config writes it; flags go over it")
      ->configurable(false);
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.add_flag("--print-config", options.print_config, "Print all settings with their units and end")
      ->configurable(false);
  addSettingFlags(app, options);
  tg::addDatasetFlags(app, options.data);
  app.add_option("--untextured-output", options.untextured_output,
                 "Write the untextured model too (implies --compare-untextured)");
  app.add_option("--json", options.json, "Also write training.json here");
  app.add_option("--threads", options.threads, "Threads (0: all cores); the model does not depend on it")
      ->check(CLI::Range(0, 4096));
  app.add_flag("--reproducible", options.reproducible,
               "No times and no memory in training.json: same seed, same bytes");
  app.add_flag("--overwrite", options.overwrite, "Replace existing files");
  app.add_flag("-q,--quiet", options.quiet, "Errors only");
}

void addSampleOptions(CLI::App& app, std::string& folder, tg::SampleOptions& options, bool& overwrite) {
  app.add_option("folder", folder, "Folder to write")->required();
  app.add_option("--size", options.size, "Side of the images in pixels")->capture_default_str();
  app.add_option("--views", options.train_views, "Training views")->capture_default_str();
  app.add_option("--test-views", options.test_views, "Test views")->capture_default_str();
  app.add_option("--points", options.points, "Points in points3d.ply")->capture_default_str();
  app.add_option("--supersampling", options.supersampling, "Rays per pixel and axis")->capture_default_str();
  app.add_flag("--overwrite", overwrite, "Replace an existing data set");
}

}  // namespace

int main(int argc, char** argv) {
  return tg::runProgram("tgtrain", [&] {
    CLI::App app("Trains a textured Gaussian model from photographs with known cameras.", "tgtrain");
    app.failure_message(tg::usageMessage);
    app.require_subcommand(0, 1);
    Options options;
    addTrainingOptions(app, options);
    tg::SampleOptions sample_options;
    std::string sample_folder;
    bool sample_overwrite = false;
    CLI::App* sample = app.add_subcommand("make-sample", "Writes the built-in scene as a NeRF-synthetic data set");
    addSampleOptions(*sample, sample_folder, sample_options, sample_overwrite);
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      return app.exit(error) == 0 ? 0 : static_cast<int>(tg::ErrorKind::usage);
    }
    if (*sample) {
      tg::writeSample(sample_folder, sample_options, sample_overwrite);
      return 0;
    }
    return runTraining(options);
  });
}
