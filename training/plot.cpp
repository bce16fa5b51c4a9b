// SPDX-License-Identifier: Apache-2.0
// The curves of runs as three charts below each other.
#include "training/plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <utility>

#include "core/file/file.h"
#include "core/run/curves.h"
#include "core/run/live.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "core/system/numbers.h"
#include "core/system/program.h"
#include "training/cli.h"
#include "training/figures/chart.h"
#include "training/figures/report.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

using RunValue = std::optional<double> (*)(const RunMetrics&);

CurvePoints pointsOf(const RunCurves& run, const std::vector<double>& iterations, RunValue value) {
  CurvePoints points;
  for (std::size_t i = 0; value && i < run.lines.size(); ++i) {
    const std::optional<double> y = value(run.lines[i]);
    if (y && std::isfinite(*y)) points.emplace_back(iterations[i], *y);
  }
  return points;
}

// Where its stages begin, but the first.
std::vector<double> stagesOf(const RunCurves& run, const std::vector<double>& iterations) {
  std::vector<double> begins;
  for (std::size_t i = 1; i < run.lines.size(); ++i) {
    if (run.lines[i].stage == run.lines[i - 1].stage) continue;
    begins.push_back(*std::max_element(iterations.begin(), iterations.begin() + static_cast<std::ptrdiff_t>(i)));
  }
  return begins;
}

// The last test scores, or how far it is.
std::string outcome(const RunCurves& run) {
  std::string text;
  for (const RunMetrics& line : run.lines) {
    if (line.test_psnr) text = formatted(", %.2f dB held out after %s", *line.test_psnr, line.stage.c_str());
  }
  const RunMetrics& last = run.lines.back();
  return text + ", " + std::to_string(last.gaussians) + " Gaussians, " + formatSeconds(last.seconds);
}

RunCurves readRun(const fs::path& path) {
  std::error_code ignored;
  const bool folder = fs::is_directory(path, ignored);
  const fs::path file = folder ? path / kMetricsName : path;
  if (!isFile(file)) {
    throw Error(ErrorKind::cannotRead, path.string(),
                "is no run (expected a folder with " + std::string(kMetricsName) + ", as tgtrain --run makes)");
  }
  MetricsFile metrics(file);
  metrics.update();
  if (metrics.lines().empty()) throw Error(ErrorKind::badData, file.string(), "holds no line of a run's metrics");
  const fs::path whole = fs::absolute(folder ? path / "" : path).lexically_normal();
  return {(folder || whole.filename() == kMetricsName ? whole.parent_path() : whole).filename().string(),
          metrics.lines()};
}

}  // namespace

std::string curvesSvg(const std::vector<RunCurves>& runs) {
  struct Chart {
    const char* title;
    RunValue line, dots;
  };
  const std::array charts = {
      Chart{"PSNR [dB]: line training, dots held out", [](const RunMetrics& m) { return m.train_psnr; },
            [](const RunMetrics& m) { return m.test_psnr; }},
      Chart{"loss of training", [](const RunMetrics& m) { return m.loss; }, nullptr},
      Chart{"Gaussians", [](const RunMetrics& m) { return std::optional(static_cast<double>(m.gaussians)); }, nullptr}};
  CurveSheet sheet{"curves of training", "iterations of the run; an upright line: a stage begins", {}, {}, {}};
  for (const Chart& chart : charts) sheet.charts.push_back({chart.title, {}});
  for (const RunCurves& run : runs) {
    const std::vector<double> iterations = iterationsOfRun(run.lines);
    sheet.labels.push_back(displayText(run.name + outcome(run)));
    sheet.marks.push_back(stagesOf(run, iterations));
    for (std::size_t i = 0; i < charts.size(); ++i) {
      sheet.charts[i].curves.push_back(
          {pointsOf(run, iterations, charts[i].line), pointsOf(run, iterations, charts[i].dots)});
    }
  }
  return svgOf(sheet);
}

void addPlotOptions(CLI::App& app, PlotOptions& options) {
  app.add_option("runs", options.runs, "Run folders, or metrics.jsonl files")->type_name("RUN");
  app.add_option("-o,--output", options.output, "Picture to write: .svg or .html")->type_name("FILE");
  app.add_flag("--overwrite", options.overwrite, "Replace an existing file");
  app.add_flag("-q,--quiet", options.quiet, "Errors only");
  addExamples(app, {{"tgtrain plot run -o curves.svg", "the curves of a run"},
                    {"tgtrain plot run other-run -o curves.svg", "two runs beside each other"},
                    {"tgtrain plot run -o curves.html", "as a page"},
                    {"tgtrain plot run -o curves.svg --overwrite", "anew, of a run that goes on"},
                    {"tgtrain plot run/metrics.jsonl -o curves.svg", "of the file alone"}});
}

void plotRuns(const PlotOptions& options) {
  if (options.runs.empty() || options.output.empty()) {
    const std::string output = "-o curves.svg (see tgtrain plot --help)";
    throw Error(ErrorKind::usage, !options.output.empty() ? "plot: expected a run folder (see tgtrain plot --help)"
                                  : options.runs.empty()  ? "plot: expected a run folder and " + output
                                                          : "plot: expected " + output);
  }
  const std::string extension = lowerExtension(options.output);
  if (extension != ".svg" && extension != ".html") {
    throw Error(ErrorKind::usage, options.output.string(),
                "unknown format" + expectedFound(".svg or .html", extension));
  }
  refuseExisting(options.output.string(), options.overwrite);
  std::vector<RunCurves> runs;
  for (const fs::path& path : options.runs) runs.push_back(readRun(path));
  // Alike, they are told apart by how they were typed.
  std::vector<std::string> names;
  for (const RunCurves& run : runs) names.push_back(run.name);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (std::ranges::count(names, names[i]) > 1) runs[i].name = options.runs[i].string();
  }
  const std::string svg = curvesSvg(runs);
  std::string text = standaloneSvg(svg);
  if (extension == ".html") {
    text = "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>" +
           htmlText(displayText(options.output.stem().string())) +
           "</title>\n<style>:root{color-scheme:light dark}body{margin:16px auto;max-width:1100px}\n" + svgStyle() +
           "</style>\n" + svg + "</html>\n";
  }
  writeTextAtomically(options.output, text);
  if (options.quiet) return;
  std::printf("wrote %s: %zu run%s\n", options.output.c_str(), runs.size(), runs.size() == 1 ? "" : "s");
}

}  // namespace tg
