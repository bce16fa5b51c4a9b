// SPDX-License-Identifier: Apache-2.0
// What tgtrain and tgeval share: flags that describe a data set, and errors to exit codes.
#pragma once
#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "training/dataset.h"

namespace tg {

struct DatasetFlags {
  std::string layout = "auto";
  std::string background;
  std::string images = "images";
  std::string points;
  int downscale = 1;
  int test_every = 8;
};
void addDatasetFlags(CLI::App& app, DatasetFlags& flags);
// Throws Error(usage) for a background that is no colour.
DatasetOptions datasetOptions(const DatasetFlags& flags);

// Runs a program's body; errors become one line on stderr and the exit code of core/error.h.
int runProgram(const char* name, const std::function<int()>& body);

}  // namespace tg
