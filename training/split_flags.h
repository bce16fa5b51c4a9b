// SPDX-License-Identifier: Apache-2.0
// tgtrain split: a scene in blocks, and the list of trainings that a farm makes of it.
#pragma once
#include <CLI/CLI.hpp>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "training/cli.h"

namespace tg {

struct SplitFlags {
  std::string dataset;
  std::string output;
  std::string grid;  // "3x2"; "": as memory asks
  std::uint64_t memory = 0;
  std::size_t gaussians = 0;
  double padding = 20;  // [%]
  std::optional<std::size_t> least;
  std::size_t most = 1500;
  std::string context;  // of every training; "": none
  std::string train;    // flags of every training
  DatasetFlags data;
  bool quiet = false;
};
void addSplitFlags(CLI::App& app, SplitFlags& flags);

// Throws Error(usage / cannotRead / badData / cannotWrite).
void splitScene(const SplitFlags& flags);

}  // namespace tg
