// SPDX-License-Identifier: Apache-2.0
// tgtrain plot: curves of one or several runs as a picture.
#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "core/run/metrics.h"

namespace tg {

struct PlotOptions {
  std::vector<std::filesystem::path> runs;  // folders, or metrics.jsonl files
  std::filesystem::path output;             // .svg or .html
  bool overwrite = false;
  bool quiet = false;
};
void addPlotOptions(CLI::App& app, PlotOptions& options);

struct RunCurves {
  std::string name;
  std::vector<RunMetrics> lines;  // in order
};
// PSNR, loss and Gaussians over the iterations of the runs, all stages behind each other. Same curves in, same text
// out.
std::string curvesSvg(const std::vector<RunCurves>& runs);

// Throws Error(usage / cannotRead / badData / cannotWrite).
void plotRuns(const PlotOptions& options);

}  // namespace tg
