// SPDX-License-Identifier: Apache-2.0
// The flags of `tgtrain farm`, and its words on the terminal.
#pragma once
#include <CLI/CLI.hpp>
#include <string>

#include "training/farm/work.h"

namespace tg {

struct FarmFlags {
  FarmOptions farm;
  std::string status;  // a farm's folder to look at, instead of working
  std::string html;    // page of the status to write
  bool overwrite = false;
  bool quiet = false;
};
void addFarmFlags(CLI::App& app, FarmFlags& flags);

// Returns the exit code. Ctrl-C, kill and a closed terminal end the training at work with a checkpoint and leave its
// job to others; a second one ends the program at once.
int runFarm(const FarmFlags& flags);

}  // namespace tg
