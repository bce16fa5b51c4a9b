// SPDX-License-Identifier: Apache-2.0
// What tgtrain and tgeval share: flags that describe a data set, the device, and what may be overwritten.
#pragma once
#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "training/data/dataset.h"
#include "training/step/gradient.h"

namespace tg {

struct DatasetFlags {
  std::string layout = "auto";
  std::string background;
  std::string images = "images";
  std::string points;
  int downscale = 1;
  int test_every = 8;
  bool normalize = false;
  bool validation = false;
  std::string masks = "hidden";
  std::uint64_t image_memory = 0;  // [MiB]; 0: a quarter of the machine's
};
void addDatasetFlags(CLI::App& app, DatasetFlags& flags);
// Throws Error(usage) for a background that is no colour.
DatasetOptions datasetOptions(const DatasetFlags& flags);

void addDeviceFlag(CLI::App& app, std::string& device, const std::string& help);
// For "cuda", or where "auto" finds one, a CUDA device's renderer; null: the CPU's turn, with the reason in `why_cpu`
// where auto found none that works. Throws Error(device) where "cuda" does not work.
std::unique_ptr<DifferentiableRenderer> openCuda(const std::string& device, std::string& why_cpu);

// What loading a data set found worth saying, one line each on stderr.
void printNotes(const std::string& folder, const Dataset& dataset);

// As the file of --json: standard output, which then holds nothing else.
constexpr const char* kStandardOutput = "-";

// Throws Error(cannotWrite) when there is something at `path`, unless it may be replaced.
void refuseExisting(const std::string& path, bool overwrite);

}  // namespace tg
