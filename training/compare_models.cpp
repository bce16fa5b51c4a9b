// SPDX-License-Identifier: Apache-2.0
// View by view, every model: a photograph is read once, and only crops stay in memory.
#include "training/compare_models.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <list>
#include <set>
#include <utility>

#include "core/model/verbs.h"
#include "core/system/error.h"
#include "training/figures/report.h"
#include "training/run/report.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

struct Contestant {
  EvalScene scene;
  EvalPictures pictures;
  ReportedModel reported;
};

// Of the models of one data set: file names without what all files have, with their folder's, as it was typed, where
// two are alike.
std::vector<std::string> labelsOf(const std::vector<std::string>& models) {
  const auto stem = [](const fs::path& path) { return displayText(path.stem().string()); };
  std::vector<std::string> labels;
  std::set<std::string> taken;
  for (const fs::path path : models) {
    const auto alike =
        std::count_if(models.begin(), models.end(), [&](const fs::path other) { return stem(other) == stem(path); });
    const std::string folder = displayText(path.parent_path().filename().string());
    const std::string label = alike > 1 && !folder.empty() ? folder + "/" + stem(path) : stem(path);
    std::string unique = label;
    for (int number = 2; !taken.insert(unique).second; ++number) unique = label + " (" + std::to_string(number) + ")";
    labels.push_back(unique);
  }
  return labels;
}

// What the photographs lie over: what all models were trained against that know it.
std::optional<glm::vec3> backgroundOf(const EvalGroup& group, std::span<const EvalScene> scenes,
                                      const EvalOptions& options) {
  std::optional<glm::vec3> background;
  if (!options.data.background.empty()) return background;
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    if (!scenes[i].trained.background) continue;
    if (background && *background != *scenes[i].trained.background) {
      throw Error(ErrorKind::usage, group.models[i],
                  "was trained against another background than the models before it (expected --background)");
    }
    background = scenes[i].trained.background;
  }
  return background;
}

void scoreView(const Dataset& dataset, std::size_t view, const ScoreOptions& how, std::list<Contestant>& contestants,
               CropChooser& crops) {
  const Camera& camera = dataset.views[view];
  const std::shared_ptr<const ViewPixels> photograph = dataset.pixels(view);
  std::vector<Image> pictures, errors;
  for (Contestant& contestant : contestants) {
    const auto scored = [&](const Image& picture, Image* error) {
      return tg::scoreView(camera.name, *photograph, picture, how, error);
    };
    pictures.push_back(contestant.pictures.draw(camera));
    contestant.reported.full.push_back(scored(pictures.back(), &errors.emplace_back()));
    if (!isTextured(*contestant.scene.model)) continue;
    const EvalPictures::Parts parts = contestant.pictures.drawParts(camera);
    contestant.reported.base.push_back(scored(parts.base, nullptr));
    contestant.reported.texture.push_back(scored(parts.texture, nullptr));
  }
  const Image truth = photograph->image();
  crops.see({camera.name, truth, pictures, errors});
}

// What a command line asks to see, and what of it some data set can show.
struct Wish {
  CropWish crop;
  bool granted = false;
};

ReportedDataset scoreGroup(const EvalOptions& options, const EvalGroup& group, std::vector<std::string> labels,
                           const ScoreOptions& how, std::vector<Wish>& wishes, bool last,
                           const std::atomic<bool>& stop) {
  std::vector<EvalScene> scenes;
  for (const std::string& model : group.models) scenes.push_back(readEvalScene(model, options.quiet));
  const Dataset dataset = readEvalViews(options, group.dataset, backgroundOf(group, scenes, options));
  for (std::size_t i = 0; i < scenes.size() && !options.quiet; ++i) {
    warnOfOtherViews(group.models[i], scenes[i], dataset);
  }
  RenderSettings settings = options.render;
  settings.background = dataset.background;
  std::list<Contestant> contestants;
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    ReportedModel reported{std::move(labels[i]), numbersOf(*scenes[i].model, scenes[i].bytes), {}, {}, {}};
    contestants.push_back({scenes[i], EvalPictures(options.device, scenes[i].model, settings), std::move(reported)});
  }
  std::vector<CropWish> wanted;
  for (Wish& wish : wishes) {
    const auto shows = [&](const Camera& view) { return grants(view.name, view.size, wish.crop); };
    wish.granted = wish.granted || std::ranges::any_of(dataset.views, shows);
    if (last && !wish.granted) refuseWish(wish.crop);
    wanted.push_back(wish.crop);
  }
  CropChooser crops(std::move(wanted), options.found_crops);
  ReportedDataset result{displayText(dataset.name), options.split, dataset.views.size(), {}, {}};
  ProgressLine progress;
  if (!options.quiet) progress.show("scoring views", 0, result.asked);
  for (std::size_t view = 0; view < result.asked && !(stop && view > 0); ++view) {
    if (view + 1 < result.asked) dataset.prefetch(view + 1);
    scoreView(dataset, view, how, contestants, crops);
    if (!options.quiet) progress.show("scoring views", view + 1, result.asked);
  }
  progress.finish();
  for (Contestant& contestant : contestants) result.models.push_back(std::move(contestant.reported));
  result.crops = crops.finish();
  return result;
}

void print(const EvalComparison& report) {
  const ReportedDataset* last = nullptr;
  for (const ReportRow& row : rowsOf(report)) {
    if (last != &row.dataset) {
      std::printf("%s, %s split, %zu views\n", row.dataset.name.c_str(), row.dataset.split.c_str(),
                  row.model.full.size());
    }
    last = &row.dataset;
    const bool full = std::string_view(row.part) == "full";
    std::printf("  %-40s  PSNR %s dB  SSIM %.4f  FLIP %.4f", full ? row.model.label.c_str() : row.part,
                decibels(row.mean.psnr, 2).c_str(), row.mean.ssim, row.mean.flip.value_or(0));
    if (row.mean.lpips) std::printf("  LPIPS %.4f", *row.mean.lpips);
    std::printf("\n");
  }
}

}  // namespace

std::vector<EvalGroup> groupsOf(std::span<const std::string> arguments) {
  std::vector<EvalGroup> groups(1);
  for (const std::string& argument : arguments) {
    std::error_code ignored;
    if (!fs::is_directory(argument, ignored)) {
      if (!groups.back().dataset.empty()) groups.emplace_back();
      groups.back().models.push_back(argument);
      continue;
    }
    if (groups.back().models.empty() || !groups.back().dataset.empty()) {
      const fs::path inside = fs::path(argument) / "model.tgz";  // of a run folder
      const std::string hint = fs::exists(inside, ignored) ? " (did you mean " + printable(inside.string()) + "?)" : "";
      throw Error(ErrorKind::usage, argument,
                  "is a folder without a model before it (expected models, then their data set)" + hint);
    }
    groups.back().dataset = argument;
  }
  return groups;
}

void compareModels(const EvalOptions& options, std::span<const EvalGroup> groups, const std::atomic<bool>& stop) {
  std::size_t models = 0;
  for (const EvalGroup& group : groups) {
    if (group.dataset.empty()) {
      throw Error(ErrorKind::usage, group.models.front(), "has no data set after it (expected a folder)");
    }
    models += group.models.size();
  }
  if (!options.labels.empty() && options.labels.size() != models) {
    throw Error(ErrorKind::usage, "--label",
                "expected one for each model" + expectedFound(models, options.labels.size()));
  }
  std::vector<Wish> wishes;
  for (const std::string& crop : options.crops) wishes.push_back({parseCropWish(crop, "--crop")});
  requireReportFolder(options.report, options.overwrite);
  std::optional<Lpips> lpips;
  if (!options.lpips.empty()) lpips.emplace(Safetensors::read(options.lpips));
  EvalComparison report;
  report.flip_pixels_per_degree = options.pixels_per_degree;
  if (lpips) {
    report.lpips = std::string(name(lpips->network())) + ", input in " + std::string(name(options.lpips_range));
  }
  auto label = options.labels.begin();
  for (const EvalGroup& group : groups) {
    if (stop && !report.datasets.empty()) break;
    std::vector<std::string> labels = labelsOf(group.models);
    if (!options.labels.empty()) {
      for (std::string& own : labels) own = displayText(*label++);
    }
    report.datasets.push_back(scoreGroup(options, group, std::move(labels), scoreOptions(options, lpips), wishes,
                                         &group == &groups.back(), stop));
  }
  if (!options.quiet) print(report);
  writeReportFolder(options.report, options.overwrite, reportFiles(report));
  if (stop && !options.quiet) std::printf("interrupted: the report is of what was scored\n");
}

}  // namespace tg
