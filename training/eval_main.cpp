// SPDX-License-Identifier: Apache-2.0
// tgeval: models against the photographs of data sets, per view and in the mean; the shapes of their Gaussians.
#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <optional>
#include <set>

#include "converter/registry/file_format.h"
#include "core/bundle/blocks.h"
#include "core/file/file.h"
#include "core/image/drawn.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "core/system/program.h"
#include "core/system/signals.h"
#include "training/compare_models.h"
#include "training/data/plan_blocks.h"
#include "training/run/report.h"
#include "training/score/eval_report.h"
#include "training/score_model.h"

namespace {

namespace fs = std::filesystem;

std::atomic<bool> stop_requested{false};
std::atomic<int> stop_signal{0};

// The first Ctrl-C ends after the current view and reports what was scored; the second ends the program at once.
void requestStop(int signal) {
  int none = 0;
  if (!stop_signal.compare_exchange_strong(none, signal)) tg::endAtOnce(signal);
  stop_requested = true;
}

// Where each picture goes, by view: named after the photograph's file, with a number where that is taken (train/0.png
// and test/0.png). Names come from the data set: their folders are left aside, so that nothing lands elsewhere.
std::vector<fs::path> pictureFiles(const std::string& folder, const tg::Dataset& dataset, bool overwrite) {
  std::vector<fs::path> files(dataset.views.size());
  if (folder.empty()) return files;
  std::error_code code;
  fs::create_directories(folder, code);
  if (code) throw tg::Error(tg::ErrorKind::cannotWrite, folder, "cannot make this folder: " + code.message());
  std::set<std::string> taken;
  for (std::size_t view = 0; view < files.size(); ++view) {
    const std::string stem = fs::path(dataset.views[view].name).stem().string();
    std::string name = stem;
    for (int number = 2; !taken.insert(name).second; ++number) name = stem + "-" + std::to_string(number);
    files[view] = fs::path(folder) / (name + ".png");
    tg::refuseExisting(files[view].string(), overwrite);
  }
  return files;
}

tg::EvalReport::Views score(const tg::EvalOptions& options, const tg::EvalGroup& group, const tg::EvalScene& scene,
                            const std::optional<tg::Lpips>& lpips) {
  const tg::Dataset dataset = tg::readEvalViews(options, group.dataset, scene.trained.background);
  if (!options.quiet) tg::warnOfOtherViews(group.models.front(), scene, dataset);
  if (!options.side_by_side.empty()) {
    for (const tg::Camera& view : dataset.views) tg::requireSideBySide(view.size, options.side_by_side);
  }
  const std::vector<fs::path> pictures = pictureFiles(options.images, dataset, options.overwrite);
  const std::vector<fs::path> comparisons = pictureFiles(options.side_by_side, dataset, options.overwrite);
  tg::EvalReport::Views views;
  views.dataset = dataset.name;
  views.split = options.split;
  views.background = dataset.background;
  views.outside = options.render.outside;
  views.asked = dataset.views.size();
  views.options = tg::scoreOptions(options, lpips);

  std::optional<tg::EvalScene> whole;
  if (!options.blocks.empty()) {
    if (dataset.points.position.empty()) {
      throw tg::Error(tg::ErrorKind::badData, group.dataset, "has no points, by which --blocks tells seams");
    }
    views.seams.emplace();
    views.seams->at_seams = tg::viewsAtSeams(dataset, tg::readBlocks(options.blocks));
    if (!options.whole.empty()) whole = tg::readEvalScene(options.whole, options.quiet);
  }
  tg::RenderSettings settings = options.render;
  settings.background = dataset.background;
  std::optional<tg::EvalPictures> whole_renderer;
  if (whole) whole_renderer.emplace(options.device, whole->model, settings);
  tg::EvalPictures renderer(options.device, scene.model, settings);
  views.device = renderer.device();
  tg::handleStopSignals(requestStop);
  tg::ProgressLine progress;
  if (!options.quiet) progress.show("scoring views", 0, views.asked);
  for (std::size_t i = 0; i < views.asked && !stop_requested; ++i) {
    if (i + 1 < views.asked) dataset.prefetch(i + 1);
    const tg::Camera& camera = dataset.views[i];
    const tg::Image picture = renderer.draw(camera);
    const std::shared_ptr<const tg::ViewPixels> photograph = dataset.pixels(i);
    tg::Image flip_map;
    views.scores.push_back(tg::scoreView(camera.name, *photograph, picture, views.options, &flip_map));
    if (whole_renderer) {
      const tg::Image unsplit = whole_renderer->draw(camera);
      views.seams->whole.push_back(tg::scoreView(camera.name, *photograph, unsplit, {}));
    }
    if (!pictures[i].empty()) tg::writeDrawn(pictures[i], picture);
    if (!comparisons[i].empty()) tg::writeDrawn(comparisons[i], tg::sideBySide(*photograph, picture, flip_map));
    if (!options.quiet) progress.show("scoring views", i + 1, views.asked);
  }
  progress.finish();
  return views;
}

int scoreOne(const tg::EvalOptions& options, const tg::EvalGroup& group) {
  const bool to_file = !options.json.empty() && options.json != tg::kStandardOutput;
  if (to_file) {
    tg::requireWritable(options.json);
    tg::refuseExisting(options.json, options.overwrite);
  }
  std::optional<tg::Lpips> lpips;
  if (!options.lpips.empty()) lpips.emplace(tg::Safetensors::read(options.lpips));
  const tg::EvalScene scene = tg::readEvalScene(group.models.front(), options.quiet);
  tg::EvalReport report;
  report.gaussians = scene.model->size();
  report.texels = scene.model->atlas.texels.size();
  report.parameters = tg::parameterCount(*scene.model);
  report.bytes = scene.bytes;
  if (options.effective_rank) {
    report.ranks = tg::effectiveRanks(scene.model->log_scale);
    if (options.talks()) std::fputs(tg::formatRanks(*report.ranks).c_str(), stdout);
  }
  if (!group.dataset.empty()) {
    report.views = score(options, group, scene, lpips);
    if (options.talks()) std::fputs(tg::formatScores(report).c_str(), stdout);
  }
  if (to_file) tg::writeTextAtomically(options.json, tg::formatEvalJson(report));
  if (options.json == tg::kStandardOutput) std::fputs(tg::formatEvalJson(report).c_str(), stdout);
  const bool interrupted = report.views && report.views->scores.size() < report.views->asked;
  return interrupted ? 128 + stop_signal : 0;
}

// A flag that would do nothing is a mistake of whoever typed it.
void refuseIdleFlags(const CLI::App& app, const tg::EvalOptions& options, const std::vector<tg::EvalGroup>& groups) {
  const auto refuse = [&](std::initializer_list<const char*> flags, const std::string& problem) {
    for (const char* flag : flags) {
      if (app.count(flag) > 0) throw tg::Error(tg::ErrorKind::usage, flag, problem);
    }
  };
  if (options.report.empty()) {
    refuse({"--label", "--crop", "--crops"}, "is of a report (expected --report with it)");
  } else {
    refuse({"--json", "--images", "--side-by-side", "--effective-rank"},
           "is not of a report, which has all that for every model (expected no --report with it)");
  }
  if (!options.report.empty()) refuse({"--blocks"}, "is not of a report (expected no --report with it)");
  if (options.blocks.empty()) refuse({"--whole"}, "is compared at seams (expected --blocks with it)");
  if (options.lpips.empty()) refuse({"--lpips-range"}, "says how (expected --lpips with it)");
  const bool writes = !options.report.empty() || (!options.json.empty() && options.json != tg::kStandardOutput) ||
                      !options.images.empty() || !options.side_by_side.empty();
  if (!writes) refuse({"--overwrite"}, "replaces files (expected an output with it)");
  if (!groups.back().dataset.empty() || !options.report.empty()) return;
  for (const CLI::Option* option : app.get_options()) {
    const std::string name = option->get_name();
    static const std::set<std::string> idle_free = {"models",    "--json",      "--effective-rank",
                                                    "--threads", "--overwrite", "--quiet"};
    if (option->count() > 0 && name.starts_with("--") && !idle_free.contains(name)) {
      throw tg::Error(tg::ErrorKind::usage, name, "is about photographs (expected a data set after the model)");
    }
  }
}

int run(const CLI::App& app, const tg::EvalOptions& options, const std::vector<std::string>& arguments) {
  const std::vector<tg::EvalGroup> groups = tg::groupsOf(arguments);
  if (options.report.empty() && (groups.size() > 1 || groups.front().models.size() > 1)) {
    const std::string& second = groups.front().models.size() > 1 ? groups.front().models[1] : groups[1].models.front();
    std::error_code ignored;
    if (!fs::exists(second, ignored)) throw tg::Error(tg::ErrorKind::cannotRead, second, "no such file or folder");
    throw tg::Error(tg::ErrorKind::usage, second, "is a second model (expected --report with several)");
  }
  if (groups.front().dataset.empty() && !options.effective_rank && options.report.empty()) {
    throw tg::Error(tg::ErrorKind::usage, "expected a model and a data set (see --help)");
  }
  if (!options.images.empty() && !options.side_by_side.empty() &&
      tg::placeOfOutput(options.images) == tg::placeOfOutput(options.side_by_side)) {
    throw tg::Error(tg::ErrorKind::usage, options.images, "is named for two outputs (expected different folders)");
  }
  refuseIdleFlags(app, options, groups);
  if (options.threads > 0) tg::setThreadCount(options.threads);
  if (options.report.empty()) return scoreOne(options, groups.front());
  tg::handleStopSignals(requestStop);
  tg::compareModels(options, groups, stop_requested);
  return stop_requested ? 128 + stop_signal : 0;
}

}  // namespace

int main(int argc, char** argv) {
  return tg::runProgram("tgeval", [&] {
    CLI::App app("Compares renderings of models with the photographs of a data set.", "tgeval");
    tg::EvalOptions options;
    std::vector<std::string> arguments;
    std::string lpips_range = "symmetric", outside;
    app.add_option("models", arguments,
                   "A model, then its data set's folder, as for tgtrain; with --report several models before each "
                   "folder, and several folders. Models: " +
                       tg::listed(tg::inputNames()))
        ->required()
        ->type_name("FILE");
    app.option_defaults()->group("What is scored");
    app.add_option("--split", options.split, "Which views")
        ->check(tg::oneOf({"test", "train", "all"}))
        ->capture_default_str();
    app.add_option("--outside", outside, tg::renderSetting("outside").help)->check(tg::oneOf<tg::TextureOutside>());
    app.add_option("--flip-ppd", options.pixels_per_degree, "FLIP: pixels per degree of vision")
        ->check(tg::within(1.0, 10000.0))
        ->capture_default_str();
    app.add_option("--lpips", options.lpips, "LPIPS with these weights (.safetensors, see docs/training.md)")
        ->type_name("FILE");
    app.add_option("--lpips-range", lpips_range, "LPIPS input: symmetric = [-1,1], unit = [0,1]")
        ->check(tg::oneOf({"symmetric", "unit"}))
        ->capture_default_str();
    app.add_flag("--effective-rank", options.effective_rank,
                 "Histogram of the shapes of the Gaussians, needle to disc to ball; needs no data set");
    app.add_option("--blocks", options.blocks,
                   "Folder of tgtrain split: also the means of views that see several cells, and of the others")
        ->type_name("FOLDER");
    app.add_option("--whole", options.whole, "With --blocks: a model of the same scene that was trained unsplit")
        ->type_name("FILE");
    app.option_defaults()->group("What is written");
    app.add_option("--json", options.json, "Write the numbers here; -: to standard output, without the table")
        ->type_name("FILE");
    app.add_option("--images", options.images, "Write the renderings into this folder")->type_name("FOLDER");
    app.add_option("--side-by-side", options.side_by_side,
                   "Write photograph | rendering | FLIP error into this folder, as PNG")
        ->type_name("FOLDER");
    app.add_flag("--overwrite", options.overwrite, "Replace existing files");
    app.add_flag("-q,--quiet", options.quiet, "Errors only: no table, no progress");
    app.option_defaults()->group("Report");
    app.add_option("--report", options.report,
                   "Write tables (HTML, CSV, LaTeX), charts (SVG) and crops of all models into this folder")
        ->type_name("FOLDER");
    app.add_option("--label", options.labels, "What a model is called in the report: once for each, in their order")
        ->type_name("LABEL")
        ->allow_extra_args(false);
    app.add_option("--crop", options.crops, "x,y,w,h or x,y,w,h@VIEW [px]: show this in the report; may be repeated")
        ->type_name("CROP")
        ->allow_extra_args(false);
    app.add_option("--crops", options.found_crops, "Crops of each data set that the report chooses")
        ->check(tg::within(0, 100))
        ->capture_default_str();
    app.option_defaults()->group("Device");
    tg::addDatasetFlags(app, options.data);
    app.remove_option(app.get_option("--points"));  // training alone starts from points
    app.get_option("--background")->description("white, black or r,g,b in [0,1], instead of the model's own");
    tg::addDeviceFlag(app, options.device,
                      "Where to draw; auto: a CUDA device if there is one; metrics are the CPU's work");
    app.add_option("--threads", options.threads, "Threads (0: all cores)")->check(tg::within(0, 4096));
    tg::addExamples(app,
                    {{"tgeval model.tgz scene", "PSNR, SSIM and FLIP of every test view"},
                     {"tgeval model.tgz scene --json - | jq .psnr", "for programs"},
                     {"tgeval model.tgz scene --side-by-side sides", "pictures beside their photographs"},
                     {"tgeval scene.sog scene --split all --images out", "renderings of all views"},
                     {"tgeval model.tgz scene --lpips vgg.safetensors", "LPIPS, too"},
                     {"tgeval city.tgz city --blocks blocks --whole one.tgz", "what seams of blocks cost"},
                     {"tgeval model.tgz --effective-rank", "the shapes of its Gaussians"}},
                    "Interrupted it reports what was scored and exits with 128 + the signal's number.");
    if (const std::optional<int> code = tg::parseCommandLine(app, argc, argv)) return *code;
    if (lpips_range == "unit") options.lpips_range = tg::LpipsRange::unit;
    if (!outside.empty()) tg::renderSetting("outside").set(options.render, outside, "--outside");
    return run(app, options, arguments);
  });
}
