// SPDX-License-Identifier: Apache-2.0
// Flags, and a line of what was written.
#include "training/data_commands.h"

#include <cstdio>

#include "core/system/program.h"
#include "training/data/write_dataset.h"

namespace tg {

void addSampleFlags(CLI::App& app, SampleFlags& flags) {
  SampleOptions& options = flags.sample;
  app.add_option("folder", flags.folder, "Folder to write")->required()->type_name("FOLDER");
  app.add_option("--size", options.size, "Side of the images in pixels")->capture_default_str();
  app.add_option("--views", options.train_views, "Training views")->capture_default_str();
  app.add_option("--test-views", options.test_views, "Test views")->capture_default_str();
  app.add_option("--points", options.points, "Points in points3d.ply, about")->capture_default_str();
  app.add_option("--supersampling", options.supersampling, "Rays per pixel and axis")->capture_default_str();
  app.add_option("--grid", options.grid, "Grow it to so many cells a side, which share views and points")
      ->capture_default_str();
  app.add_flag("--overwrite", flags.overwrite, "Replace an existing data set");
  app.add_flag("-q,--quiet", flags.quiet, "Errors only");
  addExamples(app, {{"tgtrain make-sample scene", "the built-in scene"},
                    {"tgtrain make-sample scene --size 400 --views 60", "larger, and seen from more places"},
                    {"tgtrain make-sample scene --overwrite", "anew"},
                    {"tgtrain make-sample tiny --size 32 --views 4 --test-views 2", "for a test of a second"},
                    {"tgtrain make-sample scene && tgtrain scene -o model.tgz", "and train it"}});
}

void makeSample(const SampleFlags& flags) {
  writeSample(flags.folder, flags.sample, flags.overwrite);
  if (flags.quiet) return;
  std::printf("wrote %d photographs to %s\n", flags.sample.train_views + flags.sample.test_views, flags.folder.c_str());
}

void addUndistortFlags(CLI::App& app, UndistortFlags& flags) {
  app.add_option("dataset", flags.data, "Data set to read")->required()->type_name("FOLDER");
  app.add_option("folder", flags.folder, "Folder to write")->required()->type_name("FOLDER");
  app.add_flag("--overwrite", flags.overwrite, "Replace an existing data set");
  app.add_flag("-q,--quiet", flags.quiet, "Errors only");
  addDatasetFlags(app, flags.dataset);
  app.remove_option(app.get_option("--normalize"));  // what is written is the data set's world
  addExamples(app, {{"tgtrain undistort fox straight", "photographs of pinhole cameras"},
                    {"tgtrain undistort fox straight --downscale 2", "at half the size"},
                    {"tgtrain undistort truck straight --layout colmap", "of a folder that holds several layouts"},
                    {"tgtrain undistort fox straight --overwrite", "anew"},
                    {"tgview model.tgz --photos straight", "to compare a model with"}});
}

void undistort(const UndistortFlags& flags) {
  DatasetOptions dataset_options = datasetOptions(flags.dataset);
  if (!dataset_options.background) dataset_options.random_background = true;
  std::error_code ignored;
  if (std::filesystem::equivalent(flags.data, flags.folder, ignored)) {
    throw Error(ErrorKind::usage, flags.folder, "is the data set itself (expected another folder)");
  }
  const Dataset dataset = loadDataset(flags.data, dataset_options);
  printNotes(flags.data, dataset);
  writeDataset(flags.folder, dataset, flags.overwrite);
  if (!flags.quiet) std::printf("wrote %zu photographs to %s\n", dataset.views.size(), flags.folder.c_str());
}

}  // namespace tg
