// SPDX-License-Identifier: Apache-2.0
// tgtrain: its commands, and one training where none is named.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>

#include "core/file/file.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "core/system/program.h"
#include "core/system/shell_word.h"
#include "core/system/signals.h"
#include "training/cli.h"
#include "training/data_commands.h"
#include "training/farm_flags.h"
#include "training/mpi/launch.h"
#include "training/outputs.h"
#include "training/photos_flags.h"
#include "training/plot.h"
#include "training/run/run_folder.h"
#include "training/split_flags.h"
#include "training/together.h"
#include "training/train.h"
#include "training/train_flags.h"
#include "training/watch.h"

namespace {

namespace fs = std::filesystem;

// Before hours of COLMAP: a model of before that would then be in the way, or what is in a run folder that is not the
// work folder's own, since training does not go on with it.
void refuseLaterRun(const tg::PhotosOptions& photos, tg::Ledger& ledger, const std::string& made_of,
                    const tg::TrainFlags& options, bool own_run) {
  const std::optional<tg::PhotoStage> undone = tg::undoneStage(photos, ledger);
  if (!undone && ledger.isBegun(tg::PhotoStage::training, made_of)) return;
  try {
    tg::checkOutputs(options, false);
    if (!own_run) {
      tg::RunFolderOptions run = options.run;
      run.resume = false;
      run.overwrite = options.overwrite;
      const tg::RunFolder free(run);
    }
  } catch (const tg::Error& error) {
    throw tg::Error(error.kind, error.what() + ("; for this input and these flags " + photos.work.string()) +
                                    " is made anew from its " +
                                    std::string(name(undone.value_or(tg::PhotoStage::training))) + " on");
  }
}

int runPhotos(const tg::PhotosFlags& flags, tg::TrainFlags& options) {
  if (options.print_config) return tg::train(options);
  if (options.dataset.empty() || options.output.empty()) {
    throw tg::Error(tg::ErrorKind::usage,
                    "photos: expected a folder of photographs or a film, and -o model.tgz (see tgtrain photos --help)");
  }
  const bool own_run = options.run.folder.empty();
  const tg::PhotosOptions photos =
      tg::photosOptions(flags, options.dataset, options.output, std::max(options.threads, 0));
  if (own_run) options.run.folder = photos.work / "run";
  tg::checkTraining(options);
  std::string ignored;
  if (options.device == "cuda") tg::openCuda(options.device, ignored);
  const std::string made_of = tg::trainingMadeOf(options);
  tg::checkOutputs(options, tg::isFile(options.run.folder / "checkpoint"));
  if (options.threads > 0) tg::setThreadCount(options.threads);
  tg::checkInput(photos);
  tg::Ledger ledger(photos.work);
  refuseLaterRun(photos, ledger, made_of, options, own_run);
  tg::preparePhotosAloud(photos, ledger, options.talks(), options.quiet);

  options.title = tg::nameOf("", options.dataset);
  options.dataset = photos.work.string();
  options.run.resume = ledger.isBegun(tg::PhotoStage::training, made_of);
  options.goes_on = true;
  if (!options.run.resume) {
    tg::checkOutputs(options, false);
    tg::checkData(options);  // before the run that is there goes
    std::error_code error;
    if (own_run) fs::remove_all(options.run.folder, error);
    if (error) throw tg::Error(tg::ErrorKind::cannotWrite, options.run.folder.string(), error.message());
    ledger.begin(tg::PhotoStage::training, made_of);
  }
  const int code = tg::train(options);
  if (code != 0 || tg::stopRequested()) return code;
  if (!flags.no_open && !options.watch && tg::canShow()) {
    tg::showModel(options.output);
  } else if (options.talks()) {
    std::printf("tgview %s shows it\n", tg::shellWord(options.output).c_str());
  }
  return code;
}

// Of training's flags those that photos refuses: it writes its own data set. Help does not show them.
constexpr const char* kOfDataSets[] = {"--layout", "--image-folder"};

std::shared_ptr<CLI::App> photosApp(tg::TrainFlags& options, tg::PhotosFlags& flags) {
  auto app = std::make_shared<CLI::App>(
      "Finds the cameras of photographs or of a film by COLMAP, trains a model and opens it.", "photos");
  tg::addTrainingOptions(*app, options);
  app->get_option("dataset")
      ->description("Folder of photographs (JPEG, PNG, WebP, HEIC, AVIF), or a film")
      ->type_name("FOLDER OR FILM");
  tg::addRunOptions(*app, options);
  for (const char* flag : kOfDataSets) app->get_option(flag)->group("");
  tg::addPhotosFlags(*app, flags);
  tg::addExamples(*app, {{"tgtrain photos jpegs -o model.tgz", "a folder of photographs"},
                         {"tgtrain photos walk.mp4 -o model.tgz", "a film"},
                         {"tgtrain photos walk.mp4 -o model.tgz --frames 200", "more frames of it"},
                         {"tgtrain photos jpegs -o model.tgz --preset quick", "soon, and worse"},
                         {"tgtrain photos jpegs -o scene.sog --target-size 2MB", "a file to ship"},
                         {"tgtrain photos jpegs -o model.tgz --no-open", "without a window at the end"}});
  return app;
}

int runCommand(int argc, char** argv, std::unique_ptr<tg::Processes>& together) {
  tg::TrainFlags photos_options;
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
    for (const char* flag : kOfDataSets) {
      if (photos->count(flag) == 0) continue;
      throw tg::Error(tg::ErrorKind::usage, std::string(flag) + " is of a data set, and photos makes its own");
    }
    tg::warnIdleSettings(photos_options);
    return runPhotos(photos_flags, photos_options);
  }
  CLI::App app("Trains a textured Gaussian model from photographs with known cameras.", "tgtrain");
  app.require_subcommand(0, 1);
  tg::TrainFlags options;
  tg::addTrainingOptions(app, options);
  tg::addRunOptions(app, options);
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
  tg::SampleFlags sample_flags;
  CLI::App* sample = app.add_subcommand("make-sample", "Writes the built-in scene as a NeRF-synthetic data set");
  tg::addSampleFlags(*sample, sample_flags);
  app.add_subcommand(photos);
  tg::UndistortFlags undistort_flags;
  CLI::App* undistorted = app.add_subcommand(
      "undistort", "Writes a data set as training sees it: photographs of pinhole cameras, in nerfstudio's layout");
  tg::addUndistortFlags(*undistorted, undistort_flags);
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
      tg::refuseIdleFlags(app, options);
      if (!together || together->isFirst()) tg::warnIdleSettings(options);
    }
    return code;
  });
  if (parsed) return *parsed;
  if (*sample || *undistorted || *plotted || *split) tg::handleStopSignals(tg::endAtOnce);
  if (*sample) {
    tg::makeSample(sample_flags);
    return 0;
  }
  if (*photos) throw tg::Error(tg::ErrorKind::usage, "photos: expected before every flag (tgtrain photos FOLDER ...)");
  if (*undistorted) {
    tg::undistort(undistort_flags);
    return 0;
  }
  if (*plotted) {
    tg::plotRuns(plot_options);
    return 0;
  }
  if (*farm) return tg::runFarm(farm_flags);
  if (*split) {
    tg::splitScene(split_flags);
    return 0;
  }
  return tg::train(options, together.get());
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);  // who reads a pipe reads each line when it is said
  std::unique_ptr<tg::Processes> together;        // where mpirun has started several
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
