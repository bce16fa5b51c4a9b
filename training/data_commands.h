// SPDX-License-Identifier: Apache-2.0
// Commands of tgtrain that write data sets: make-sample, undistort.
#pragma once
#include <CLI/CLI.hpp>
#include <string>

#include "training/cli.h"
#include "training/data/sample.h"

namespace tg {

struct SampleFlags {
  std::string folder;
  SampleOptions sample;
  bool overwrite = false;
  bool quiet = false;
};
void addSampleFlags(CLI::App& app, SampleFlags& flags);
// Throws Error(usage / cannotWrite).
void makeSample(const SampleFlags& flags);

// The same flags as training, so that the same photographs come out; transparency is kept.
struct UndistortFlags {
  std::string data;
  std::string folder;
  DatasetFlags dataset;
  bool overwrite = false;
  bool quiet = false;
};
void addUndistortFlags(CLI::App& app, UndistortFlags& flags);
// Throws Error(usage / cannotRead / badData / cannotWrite).
void undistort(const UndistortFlags& flags);

}  // namespace tg
