// SPDX-License-Identifier: Apache-2.0
// tgtrain: flags to settings, errors to exit codes.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "core/error.h"
#include "training/sample.h"

int main(int argc, char** argv) {
  CLI::App app("Trains a textured Gaussian model from photographs with known cameras.");
  app.require_subcommand(1);
  CLI::App* sample = app.add_subcommand("make-sample", "Writes the built-in scene as a NeRF-synthetic data set");
  tg::SampleOptions options;
  std::string folder;
  bool overwrite = false;
  sample->add_option("folder", folder, "Folder to write")->required();
  sample->add_option("--size", options.size, "Side of the images in pixels")->capture_default_str();
  sample->add_option("--views", options.train_views, "Training views")->capture_default_str();
  sample->add_option("--test-views", options.test_views, "Test views")->capture_default_str();
  sample->add_option("--points", options.points, "Points in points3d.ply")->capture_default_str();
  sample->add_option("--supersampling", options.supersampling, "Rays per pixel and axis")->capture_default_str();
  sample->add_flag("--overwrite", overwrite, "Replace an existing data set");
  try {
    app.parse(argc, argv);
    tg::writeSample(folder, options, overwrite);
    return 0;
  } catch (const CLI::ParseError& error) {
    const int code = app.exit(error);
    return code == 0 ? 0 : static_cast<int>(tg::ErrorKind::usage);
  } catch (const tg::Error& error) {
    std::fprintf(stderr, "tgtrain: %s\n", error.what());
    return tg::exitCode(error);
  }
}
