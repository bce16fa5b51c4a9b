// SPDX-License-Identifier: Apache-2.0
// tgeval: a model against the photographs of a data set, per view and in the mean.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <span>

#include "core/bundle.h"
#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/ply.h"
#include "render/renderer.h"
#include "training/cli.h"
#include "training/evaluate.h"

namespace {

namespace fs = std::filesystem;

struct Options {
  std::string model;
  std::string dataset;
  std::string json;
  std::string images;
  std::string split = "test";
  int threads = 0;
  bool overwrite = false;
  tg::DatasetFlags data;
};

struct Scene {
  tg::GaussianModel model;
  std::optional<glm::vec3> background;  // what it was trained against
};

Scene readScene(const std::string& path) {
  if (!tg::looksLikeBundle(path)) return {tg::readSplatPly(path), std::nullopt};
  tg::Bundle bundle = tg::readBundle(path);
  for (const std::string& warning : bundle.warnings) std::fprintf(stderr, "tgeval: %s\n", warning.c_str());
  return {std::move(bundle.model), bundle.background};
}

std::vector<std::size_t> chosenViews(const tg::Dataset& dataset, const std::string& split) {
  std::vector<std::size_t> views;
  if (split == "all") {
    views.resize(dataset.views.size());
    std::iota(views.begin(), views.end(), std::size_t{0});
  } else {
    views = dataset.indices(split == "test");
  }
  if (views.empty()) {
    throw tg::Error(tg::ErrorKind::usage, dataset.name, "has no " + split + " views (try --split train)");
  }
  return views;
}

// Where each picture goes, by view: named after the photograph's file, with a number where that is taken (train/0.png
// and test/0.png). Names come from the data set: their folders are left aside, so that nothing lands elsewhere.
std::vector<fs::path> pictureFiles(const Options& options, const tg::Dataset& dataset,
                                   std::span<const std::size_t> views) {
  std::vector<fs::path> files(dataset.views.size());
  std::set<std::string> taken;
  for (const std::size_t view : views) {
    const std::string stem = fs::path(dataset.views[view].camera.name).stem().string();
    std::string name = stem;
    for (int number = 2; !taken.insert(name).second; number++) name = stem + "-" + std::to_string(number);
    files[view] = fs::path(options.images) / (name + ".png");
    tg::refuseExisting(files[view].string(), options.overwrite);
  }
  return files;
}

tg::Image toImage(const tg::Frame& frame) { return tg::extract(frame, tg::Output::final); }

std::string formatJson(const tg::Dataset& dataset, const tg::GaussianModel& model, const std::string& split,
                       std::span<const tg::ViewScore> scores) {
  const tg::Score mean = tg::meanScore(scores);
  nlohmann::ordered_json json = {{"dataset", dataset.name},
                                 {"split", split},
                                 {"gaussians", model.size()},
                                 {"texels", model.atlas.texels.size()},
                                 {"psnr", mean.psnr},
                                 {"ssim", mean.ssim},
                                 {"views", nlohmann::ordered_json::array()}};
  for (const tg::ViewScore& score : scores) {
    json["views"].push_back({{"name", score.name}, {"psnr", score.psnr}, {"ssim", score.ssim}});
  }
  return json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

int run(const Options& options) {
  if (!options.json.empty()) {
    tg::refuseExisting(options.json, options.overwrite);
    tg::requireWritable(options.json);
  }
  if (options.threads > 0) tg::setThreadCount(options.threads);
  const Scene scene = readScene(options.model);
  tg::DatasetOptions data = tg::datasetOptions(options.data);
  if (!data.background) data.background = scene.background;
  const tg::Dataset dataset = tg::loadDataset(options.dataset, data);
  const std::vector<std::size_t> views = chosenViews(dataset, options.split);
  std::vector<fs::path> files;
  if (!options.images.empty()) {
    std::error_code code;
    fs::create_directories(options.images, code);
    if (code) throw tg::Error(tg::ErrorKind::cannotWrite, options.images, code.message());
    files = pictureFiles(options, dataset, views);
  }

  const auto renderer = tg::makeCpuRenderer();
  renderer->setModel(scene.model);
  tg::RenderSettings settings;
  settings.background = dataset.background;
  std::printf("%-32s %9s %8s\n", "view", "PSNR [dB]", "SSIM");
  const std::vector<tg::ViewScore> scores = tg::scoreViews(
      dataset, views, [&](const tg::Camera& camera) { return toImage(renderer->render(camera, settings)); },
      [&](const tg::View& view, const tg::Image& picture) {
        if (!files.empty()) tg::writeImage(files[static_cast<std::size_t>(&view - dataset.views.data())], picture);
      });
  for (const tg::ViewScore& score : scores) {
    std::printf("%-32s %9.3f %8.5f\n", tg::printable(score.name).c_str(), score.psnr, score.ssim);
  }
  const tg::Score mean = tg::meanScore(scores);
  std::printf("%-32s %9.3f %8.5f   %zu views, %zu Gaussians\n", "mean", mean.psnr, mean.ssim, mean.views,
              scene.model.size());
  if (!options.json.empty()) {
    const std::string json = formatJson(dataset, scene.model, options.split, scores);
    tg::writeFileAtomically(options.json, std::span(reinterpret_cast<const std::uint8_t*>(json.data()), json.size()));
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return tg::runProgram("tgeval", [&] {
    CLI::App app("Compares renderings of a model with the photographs of a data set.", "tgeval");
    app.failure_message(tg::usageMessage);
    Options options;
    app.add_option("model", options.model, "model.tgz or splats.ply")->required();
    app.add_option("dataset", options.dataset, "Folder, as for tgtrain")->required();
    app.add_option("--split", options.split, "Which views")
        ->check(CLI::IsMember({"test", "train", "all"}))
        ->capture_default_str();
    app.add_option("--json", options.json, "Write the numbers here");
    app.add_option("--images", options.images, "Write the renderings into this folder");
    tg::addDatasetFlags(app, options.data);
    app.add_option("--threads", options.threads, "Threads (0: all cores)")->check(CLI::Range(0, 4096));
    app.add_flag("--overwrite", options.overwrite, "Replace existing files");
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      return app.exit(error) == 0 ? 0 : static_cast<int>(tg::ErrorKind::usage);
    }
    return run(options);
  });
}
