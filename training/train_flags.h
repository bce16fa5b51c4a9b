// SPDX-License-Identifier: Apache-2.0
// What tgtrain is told of a training.
#pragma once
#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>

#include "core/model/model.h"
#include "training/cli.h"
#include "training/run/run_folder.h"
#include "training/settings/settings.h"

namespace tg {

struct TrainFlags {
  std::string dataset;
  std::string output;
  std::string untextured_output;
  std::string start_model;
  std::string context;
  std::string json;
  RunFolderOptions run;
  DatasetFlags data;
  std::string preset = "default";
  std::uint64_t target_bytes = 0;                     // of the output; 0: any
  float steps = 0;                                    // of the output; 0: its own, or what target_bytes leave
  std::map<const SettingEntry*, std::string> chosen;  // over the preset; empty: not given
  std::string settings_file;                          // --config: has chosen all
  std::set<const SettingEntry*> by_flag;              // which of them flags have chosen, then
  std::string device = "auto";
  int threads = 0;
  bool overwrite = false;
  bool watch = false;
  bool goes_on = false;  // the same command does, also without --resume
  std::string serve, serve_token;
  std::string title;  // of the page; "": the data set's name
  bool quiet = false;
  bool talks() const { return !quiet && json != kStandardOutput; }  // on standard output
  bool reproducible = false;
  bool print_config = false;
};

// The preset and what goes over it. Throws Error(usage).
TrainSettings settingsOf(const TrainFlags& options);

// Data set, outputs and recipe; --config reads settings from a file.
void addTrainingOptions(CLI::App& app, TrainFlags& options);
// What goes on in a run folder, and who may look at it.
void addRunOptions(CLI::App& app, TrainFlags& options);

// A flag that would do nothing is a mistake of whoever typed it: Error(usage).
void refuseIdleFlags(const CLI::App& app, const TrainFlags& options);
// Of the recipe, which files and presets name as a whole: what a flag says and no stage uses is a line on stderr. Where
// there is a start model that follows once it is read.
void warnIdleSettings(const TrainFlags& options, const GaussianModel* start = nullptr);

}  // namespace tg
