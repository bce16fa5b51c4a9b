// SPDX-License-Identifier: Apache-2.0
// Flags to a plan, the plan to folders and a list of jobs.
#include "training/split_flags.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <vector>

#include "converter/edit/upright.h"
#include "converter/registry/file_format.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "core/system/program.h"
#include "core/system/shell_word.h"
#include "training/data/plan_blocks.h"
#include "training/farm/jobs.h"
#include "training/settings/schedule.h"
#include "training/train_flags.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr int kLongestSide = 256;  // of a grid

glm::ivec2 gridOf(const std::string& text) {
  const std::size_t cross = text.find('x');
  const int columns = parseWhole<int>(text.substr(0, cross)).value_or(0);
  const int rows = cross == text.npos ? 0 : parseWhole<int>(text.substr(cross + 1)).value_or(0);
  const auto inside = [](int side) { return side >= 1 && side <= kLongestSide; };
  if (!inside(columns) || !inside(rows)) {
    refuseValue("--blocks", text, "columns x rows of 1 to " + std::to_string(kLongestSide) + ", such as 3x2");
  }
  return {columns, rows};
}

// Of every training. What a file says to --config is not known: it is read where the training is.
TrainSettings trainedWith(const std::vector<std::string>& flags) {
  CLI::App app;
  TrainFlags options;
  addTrainingOptions(app, options);
  std::string file;
  app.set_config();
  app.set_help_flag();
  app.remove_option(app.get_option("dataset"));
  app.add_option("--config", file);
  try {
    std::vector<std::string> words(flags.rbegin(), flags.rend());
    words.insert(words.end(), {"1", "--gaussians"});  // as all of them have a count
    app.parse(std::move(words));
    return settingsOf(options);
  } catch (const CLI::Error& error) {
    throw Error(ErrorKind::usage, "--train: " + wrongFlags(app, error));
  } catch (const Error& error) {
    throw Error(error.kind, std::string("--train: ") + error.what());
  }
}

// What --train cannot say: each block is a .tgz, and has flags of its own.
void refuseOwn(const std::vector<std::string>& flags, bool by_memory, bool names_images) {
  for (const std::string& flag : flags) {
    const std::string name = flag.substr(0, flag.find('='));
    if (name == "--target-size" || name == "--steps" || name == "--quantize-iterations") {
      throw Error(ErrorKind::usage, "--train: " + name + " is for one file (expected it of tgconvert, for the whole)");
    }
    if (name == "--gaussians" || name == "--percent" || name == "--test-every" || name == "--context" ||
        name == "--layout" || name == "--points" || name == "--start-model" ||
        (by_memory && name == "--image-memory") || (names_images && name == "--image-folder")) {
      throw Error(ErrorKind::usage, "--train: " + name + " is split's own to choose (expected without it)");
    }
  }
}

}  // namespace

void addSplitFlags(CLI::App& app, SplitFlags& flags) {
  app.add_option("dataset", flags.dataset, "Data set with points; it stays where it is, blocks refer to it")
      ->required()
      ->type_name("FOLDER");
  app.add_option("folder", flags.output, "Folder to make: a data set a block, and jobs.jsonl for tgtrain farm")
      ->required()
      ->type_name("FOLDER");
  CLI::Option* grid =
      app.add_option("--blocks", flags.grid, "Columns x rows of blocks on the ground")->type_name("NxM");
  addBytes(app, "--memory", flags.memory, "As few blocks as this memory of each training allows: 16GB")->excludes(grid);
  app.add_option("--gaussians", flags.gaussians, "Of the whole scene (0: as many as points); blocks get their shares")
      ->check(within(std::size_t{0}, std::size_t{1} << 40));
  app.add_option("--padding", flags.padding, "Around each cell, trained and cropped then [% of its longer side]")
      ->check(within(0.0, 100.0))
      ->capture_default_str();
  app.add_option("--least-cameras", flags.least, "Training views of a block, where so many see it")
      ->check(within(1, 1'000'000))
      ->default_str(std::to_string(BlockOptions().least));
  app.add_option("--most-cameras", flags.most, "Training views of a block at most")
      ->check(within(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--context", flags.context, "A coarse model of the whole, which every training draws around its block")
      ->type_name("FILE");
  app.add_option("--train", flags.train, "Flags of every training, with spaces between them: \"--preset quick\"")
      ->type_name("FLAGS");
  app.add_flag("-q,--quiet", flags.quiet, "Errors only");
  addDatasetFlags(app, flags.data);
  // What decides which photographs there are; all else is of training (--train).
  for (const char* name : {"--background", "--downscale", "--masks", "--image-memory", "--validation", "--normalize"}) {
    app.remove_option(app.get_option(name));
  }
  addExamples(app, {{"tgtrain split city blocks --blocks 3x3", "nine blocks"},
                    {"tgtrain split city blocks --memory 16GB --gaussians 20000000", "as many as it takes"},
                    {"tgtrain split city blocks --blocks 2x2 --train \"--preset quick\"", "with flags"},
                    {"tgtrain farm blocks/jobs.jsonl --out farm", "then train them, anywhere"},
                    {"tgconvert merge-blocks blocks farm/results city.tgz", "and join them"}});
}

void splitScene(const SplitFlags& flags) {
  if (flags.grid.empty() == (flags.memory == 0)) {
    throw Error(ErrorKind::usage, "split: expected --blocks NxM or --memory SIZE");
  }
  if (flags.least.value_or(1) > flags.most) {
    throw Error(ErrorKind::usage,
                "split: --least-cameras is more than --most-cameras" + atMost(flags.most, *flags.least));
  }
  BlockOptions options;
  if (!flags.grid.empty()) options.grid = gridOf(flags.grid);
  options.memory = flags.memory;
  options.gaussians = flags.gaussians;
  options.padding = flags.padding / 100;
  options.least = flags.least.value_or(std::min(BlockOptions().least, flags.most));
  options.most = flags.most;
  if (!flags.context.empty()) (void)readModel(flags.context);  // before it is every training's complaint
  DatasetOptions data = datasetOptions(flags.data);
  data.cameras_only = true;
  const Dataset dataset = loadDataset(flags.dataset, data);
  printNotes(flags.dataset, dataset);
  if (dataset.block) throw Error(ErrorKind::badData, flags.dataset, "is a block already (expected a whole data set)");
  const glm::dvec3 up = upOf(dataset.views).value_or(upOfPoints(dataset.points));
  std::istringstream words(flags.train);
  const std::vector<std::string> common = {std::istream_iterator<std::string>(words), {}};
  const bool names_images = data.images != DatasetOptions().images;
  refuseOwn(common, flags.memory > 0, names_images);
  // Whether it has more Gaussians than its limit until pairs are merged.
  if (makeSchedule(trainedWith(common)).merge_after > 0) {
    options.grown = [pixels = trainingPixels(dataset)](std::size_t limit) { return grownLimit(limit, pixels); };
  }
  const std::vector<PlannedBlock> plan = planBlocks(dataset, glm::normalize(up), options);
  std::string jobs;
  for (const PlannedBlock& planned : plan) {
    if (planned.gaussians > kMaxGaussians) {
      throw Error(ErrorKind::usage, "split: " + planned.block.name + " has too many Gaussians for one training" +
                                        atMost(kMaxGaussians, planned.gaussians) + ": more blocks have fewer each");
    }
    FarmJob job{planned.block.name, planned.block.name, "model.tgz", {}};
    job.flags = {"--gaussians", std::to_string(planned.gaussians), "--test-every", std::to_string(data.test_every)};
    if (flags.memory > 0) {
      const std::uint64_t mebibytes = std::max<std::uint64_t>(1, imageMemoryOf(flags.memory) >> 20);
      job.flags.insert(job.flags.end(), {"--image-memory", std::to_string(mebibytes)});
    }
    if (names_images) job.flags.insert(job.flags.end(), {"--image-folder", data.images});
    if (!flags.context.empty()) {
      job.flags.insert(job.flags.end(),
                       {"--context", fs::proximate(fs::absolute(flags.context), fs::absolute(flags.output)).string()});
    }
    job.flags.insert(job.flags.end(), common.begin(), common.end());
    jobs += dumpJson(jsonOf(job)) + "\n";
  }
  try {
    (void)parseJobs(jobs, "--train");
  } catch (const Error& error) {  // what a farm would refuse
    throw Error(ErrorKind::usage, error.what());
  }
  writePlan(flags.output, flags.dataset, dataset, plan);
  writeTextAtomically(fs::path(flags.output) / "jobs.jsonl", jobs);
  if (flags.quiet) return;
  for (const PlannedBlock& planned : plan) {
    std::printf("%s: %zu train and %zu test views, %zu points, %zu Gaussians, about %s\n", planned.block.name.c_str(),
                planned.train_views, planned.views.size() - planned.train_views, planned.points.size(),
                planned.gaussians, memoryText(planned.memory).c_str());
  }
  std::printf("wrote %zu blocks to %s: `tgtrain farm %s --out FOLDER` trains them\n", plan.size(), flags.output.c_str(),
              shellWord(flags.output + "/jobs.jsonl").c_str());
}

}  // namespace tg
