// SPDX-License-Identifier: Apache-2.0
// tgeval: a model against the photographs of a data set, per view and in the mean; the shapes of its Gaussians.
#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <optional>
#include <set>

#include "converter/registry/file_format.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "core/system/program.h"
#include "core/system/signals.h"
#include "render/renderer.h"
#include "training/cli.h"
#include "training/run/report.h"
#include "training/score/eval_report.h"

namespace {

namespace fs = std::filesystem;

std::atomic<bool> stop_requested{false};

// The first Ctrl-C ends after the current view and reports what was scored; the second ends the program at once.
void requestStop(int signal) {
  if (stop_requested.exchange(true)) tg::endAtOnce(signal);
}

struct Options {
  std::string model;
  std::string dataset;
  std::string json;
  std::string images;
  std::string side_by_side;
  std::string lpips;
  std::string lpips_range = "symmetric";
  std::string split = "test";
  std::string device = "cpu";
  tg::RenderSettings render;
  double pixels_per_degree = tg::kFlipPixelsPerDegree;
  int threads = 0;
  bool effective_rank = false;
  bool overwrite = false;
  tg::DatasetFlags data;
};

struct Scene {
  tg::GaussianModel model;
  std::optional<glm::vec3> background;  // what it was trained against
};

Scene readScene(const std::string& path) {
  tg::Bundle bundle = tg::readModel(path);
  for (const std::string& warning : bundle.warnings) std::fprintf(stderr, "tgeval: %s\n", warning.c_str());
  // What was trained elsewhere, or went through a format that lacks it, has a background that nobody chose; cameras are
  // lost on the same ways.
  if (bundle.format != "tgz" && bundle.cameras.empty()) return {std::move(bundle.model), std::nullopt};
  return {std::move(bundle.model), bundle.background};
}

// Of the views that are asked for, and no others.
tg::Dataset readViews(const Options& options, const Scene& scene) {
  tg::DatasetOptions data = tg::datasetOptions(options.data);
  if (data.random_background) {
    throw tg::Error(tg::ErrorKind::usage, "--background: scores need one colour (expected white, black or r,g,b)");
  }
  if (!data.background) data.background = scene.background;
  if (options.split != "all") data.only_test = options.split == "test";
  tg::ProgressLine line;
  data.decoded = [&](std::size_t done, std::size_t count) { line.show("decoding photographs", done, count); };
  tg::Dataset dataset = tg::loadDataset(options.dataset, data);
  tg::printNotes(options.dataset, dataset);
  if (dataset.views.empty()) {
    throw tg::Error(tg::ErrorKind::usage, dataset.name, "has no " + options.split + " views (try --split all)");
  }
  return dataset;
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

// A model's pictures, drawn by the renderer that --device names. The model goes to it once.
class Pictures {
 public:
  Pictures(const std::string& device, const tg::GaussianModel& model, const tg::RenderSettings& settings)
      : settings_(settings) {
    std::string ignored;
    cuda_ = tg::openCuda(device, ignored);
    if (cuda_) {
      cuda_->setModel(model);
    } else {
      cpu_ = tg::makeCpuRenderer();
      cpu_->setModel(model);
    }
    settings_.outputs = {tg::Output::final};
  }
  std::string device() const { return cuda_ ? cuda_->deviceName() : cpu_->deviceName(); }
  tg::Image draw(const tg::Camera& camera) {
    tg::Image picture = cuda_ ? tg::imageOf(cuda_->forward(camera, settings_), camera)
                              : tg::extract(cpu_->render(camera, settings_), tg::Output::final);
    tg::clampToUnit(picture);
    return picture;
  }

 private:
  std::unique_ptr<tg::DifferentiableRenderer> cuda_;
  std::unique_ptr<tg::Renderer> cpu_;
  tg::RenderSettings settings_;
};

tg::EvalReport::Views score(const Options& options, const Scene& scene, const std::optional<tg::Lpips>& lpips) {
  const tg::Dataset dataset = readViews(options, scene);
  const std::vector<fs::path> pictures = pictureFiles(options.images, dataset, options.overwrite);
  const std::vector<fs::path> comparisons = pictureFiles(options.side_by_side, dataset, options.overwrite);
  tg::EvalReport::Views views;
  views.dataset = dataset.name;
  views.split = options.split;
  views.background = dataset.background;
  views.outside = options.render.outside;
  views.asked = dataset.views.size();
  views.options.flip = true;
  views.options.pixels_per_degree = options.pixels_per_degree;
  views.options.lpips = lpips ? &*lpips : nullptr;
  views.options.lpips_range = options.lpips_range == "unit" ? tg::LpipsRange::unit : tg::LpipsRange::symmetric;

  tg::RenderSettings settings = options.render;
  settings.background = dataset.background;
  Pictures renderer(options.device, scene.model, settings);
  views.device = renderer.device();
  tg::handleStopSignals(requestStop);
  tg::ProgressLine progress;
  progress.show("scoring views", 0, views.asked);
  for (std::size_t i = 0; i < views.asked && !stop_requested; ++i) {
    if (i + 1 < views.asked) dataset.prefetch(i + 1);
    const tg::Camera& camera = dataset.views[i];
    const tg::Image picture = renderer.draw(camera);
    const std::shared_ptr<const tg::ViewPixels> photograph = dataset.pixels(i);
    tg::Image flip_map;
    views.scores.push_back(tg::scoreView(camera.name, *photograph, picture, views.options, &flip_map));
    if (!pictures[i].empty()) tg::writeImage(pictures[i], picture);
    if (!comparisons[i].empty()) tg::writeImage(comparisons[i], tg::sideBySide(*photograph, picture, flip_map));
    progress.show("scoring views", i + 1, views.asked);
  }
  progress.finish();
  return views;
}

void checkOptions(const Options& options) {
  if (options.dataset.empty() && !options.effective_rank) {
    throw tg::Error(tg::ErrorKind::usage, "expected a model and a data set (see --help)");
  }
  if (!options.images.empty() &&
      (fs::path(options.images) / "").lexically_normal() == (fs::path(options.side_by_side) / "").lexically_normal()) {
    throw tg::Error(tg::ErrorKind::usage, options.images, "is named for two outputs (expected different folders)");
  }
  if (!options.json.empty()) {
    tg::refuseExisting(options.json, options.overwrite);
    tg::requireWritable(options.json);
  }
}

int run(const Options& options) {
  checkOptions(options);
  if (options.threads > 0) tg::setThreadCount(options.threads);
  std::optional<tg::Lpips> lpips;
  if (!options.lpips.empty()) lpips.emplace(tg::Safetensors::read(options.lpips));
  const Scene scene = readScene(options.model);
  tg::EvalReport report;
  report.gaussians = scene.model.size();
  report.texels = scene.model.atlas.texels.size();
  report.parameters = tg::parameterCount(scene.model);
  report.bytes = fs::file_size(options.model);
  if (options.effective_rank) {
    report.ranks = tg::effectiveRanks(scene.model.log_scale);
    std::fputs(tg::formatRanks(*report.ranks).c_str(), stdout);
  }
  if (!options.dataset.empty()) {
    report.views = score(options, scene, lpips);
    std::fputs(tg::formatScores(report).c_str(), stdout);
  }
  if (!options.json.empty()) tg::writeTextAtomically(options.json, tg::formatEvalJson(report));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return tg::runProgram("tgeval", [&] {
    CLI::App app("Compares renderings of a model with the photographs of a data set.", "tgeval");
    Options options;
    app.add_option("model", options.model, "Model: " + tg::listed(tg::inputNames()))->required();
    app.add_option("dataset", options.dataset, "Folder, as for tgtrain");
    app.add_option("--split", options.split, "Which views")
        ->check(CLI::IsMember({"test", "train", "all"}))
        ->capture_default_str();
    app.add_option("--json", options.json, "Write the numbers here");
    app.add_option("--images", options.images, "Write the renderings into this folder");
    app.add_option("--side-by-side", options.side_by_side,
                   "Write photograph | rendering | FLIP error into this folder, as PNG");
    app.add_option("--flip-ppd", options.pixels_per_degree, "FLIP: pixels per degree of vision")
        ->check(CLI::Range(1.0, 10000.0))
        ->capture_default_str();
    app.add_option("--lpips", options.lpips, "LPIPS with these weights (.safetensors, see docs/training.md)");
    app.add_option("--lpips-range", options.lpips_range, "LPIPS input: symmetric = [-1,1], unit = [0,1]")
        ->check(CLI::IsMember({"symmetric", "unit"}))
        ->capture_default_str();
    app.add_flag("--effective-rank", options.effective_rank,
                 "Histogram of the shapes of the Gaussians, needle to disc to ball; needs no data set");
    std::string outside;
    app.add_option("--outside", outside, tg::renderSetting("outside").help);
    tg::addDatasetFlags(app, options.data);
    tg::addDeviceFlag(app, options.device,
                      "Where to draw; auto: a CUDA device if there is one; metrics are the CPU's work");
    app.add_option("--threads", options.threads, "Threads (0: all cores)")->check(CLI::Range(0, 4096));
    app.add_flag("--overwrite", options.overwrite, "Replace existing files");
    if (const std::optional<int> code = tg::parseCommandLine(app, argc, argv)) return *code;
    if (!outside.empty()) tg::renderSetting("outside").set(options.render, outside, "--outside");
    return run(options);
  });
}
