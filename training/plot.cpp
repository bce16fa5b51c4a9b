// SPDX-License-Identifier: Apache-2.0
// SVG by hand: three panels under each other, a legend on top.
#include "training/plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

#include "core/file/file.h"
#include "core/run/curves.h"
#include "core/run/live.h"
#include "core/system/error.h"
#include "core/system/numbers.h"
#include "core/system/program.h"
#include "training/cli.h"

namespace tg {
namespace {

namespace fs = std::filesystem;

constexpr double kWidth = 840, kPanel = 210, kLeft = 74, kRight = 18, kGap = 46, kRow = 20;  // [px]
constexpr std::array<const char*, 8> kColors = {"#2a63c8", "#d8731f", "#2b8f5b", "#9a3fb5",
                                                "#b8323c", "#12808f", "#7a6a12", "#5a5f6b"};

using Points = std::vector<std::pair<double, double>>;

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : printable(text)) {
    out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '"' ? "&quot;" : std::string(1, c);
  }
  return out;
}

std::string at(double value) { return formatted("%.1f", value); }

std::string textAt(double x, double y, const char* anchor, const std::string& text, const std::string& more = "") {
  return "<text x=\"" + at(x) + "\" y=\"" + at(y) + "\" text-anchor=\"" + anchor + "\"" + more + ">" + text +
         "</text>\n";
}

std::string lineTo(double x1, double y1, double x2, double y2, const std::string& style) {
  return "<line x1=\"" + at(x1) + "\" y1=\"" + at(y1) + "\" x2=\"" + at(x2) + "\" y2=\"" + at(y2) + "\" " + style +
         "/>\n";
}

// About `count` round numbers.
std::vector<double> ticks(double low, double high, int count) {
  const double raw = std::max((high - low) / count, 1e-12), power = std::pow(10.0, std::floor(std::log10(raw)));
  double step = 10 * power;
  for (const double factor : {5.0, 2.0, 1.0}) {
    if (factor * power >= raw * (1 - 1e-9)) step = factor * power;
  }
  std::vector<double> values;
  for (double i = std::ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; ++i) values.push_back(i * step);
  return values;
}

std::string shortNumber(double value) {
  const double size = std::abs(value);
  if (size >= 1e6) return formatted("%.4g M", value / 1e6);
  if (size >= 1e4) return formatted("%.4g k", value / 1e3);
  return formatted("%.4g", size < 1e-12 ? 0.0 : value);
}

struct Panel {
  const char* title;
  std::function<std::optional<double>(const RunMetrics&)> curve, dots;
};

Points pointsOf(const RunCurves& run, const std::vector<double>& iterations,
                const std::function<std::optional<double>(const RunMetrics&)>& value) {
  Points points;
  for (std::size_t i = 0; value && i < run.lines.size(); ++i) {
    const std::optional<double> y = value(run.lines[i]);
    if (y && std::isfinite(*y)) points.emplace_back(iterations[i], *y);
  }
  return points;
}

// What is worst at the very beginning says nothing about the rest: the axis leaves it out.
std::pair<double, double> rangeOf(const std::vector<Points>& curves, const std::vector<Points>& dots) {
  std::vector<double> values;
  for (const Points& points : curves) {
    for (const auto& [x, y] : points) values.push_back(y);
  }
  double low = std::numeric_limits<double>::infinity(), high = -low;
  if (!values.empty()) {
    std::sort(values.begin(), values.end());
    low = values[values.size() / 100];
    high = values[values.size() - 1 - values.size() / 100];
  }
  for (const Points& points : dots) {
    for (const auto& [x, y] : points) low = std::min(low, y), high = std::max(high, y);
  }
  if (!(low <= high)) return {0, 1};
  const double room = high > low ? 0.05 * (high - low) : std::max(std::abs(high) * 0.1, 1e-6);
  return {low - room, high + room};
}

std::string panelSvg(const std::vector<RunCurves>& runs, const std::vector<std::vector<double>>& iterations,
                     const Panel& panel, double top, double last) {
  std::vector<Points> curves, dots;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    curves.push_back(pointsOf(runs[i], iterations[i], panel.curve));
    dots.push_back(pointsOf(runs[i], iterations[i], panel.dots));
  }
  const auto [low, high] = rangeOf(curves, dots);
  const double width = kWidth - kLeft - kRight, bottom = top + kPanel;
  const auto x = [&](double value) { return kLeft + value / last * width; };
  const auto y = [&, low = low, high = high](double value) {
    return bottom - (std::clamp(value, low, high) - low) / (high - low) * kPanel;
  };
  std::string svg = textAt(kLeft, top - 8, "start", panel.title, " font-weight=\"bold\"");
  for (const double value : ticks(low, high, 5)) {
    svg += lineTo(kLeft, y(value), kWidth - kRight, y(value), "stroke=\"#e3e5ea\"") +
           textAt(kLeft - 8, y(value) + 4, "end", shortNumber(value));
  }
  for (const double value : ticks(0, last, 8)) {
    svg += lineTo(x(value), bottom, x(value), bottom + 4, "stroke=\"#70747d\"") +
           textAt(x(value), bottom + 17, "middle", shortNumber(value));
  }
  svg += lineTo(kLeft, bottom, kWidth - kRight, bottom, "stroke=\"#70747d\"");
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const std::string color = kColors[i % kColors.size()];
    for (std::size_t line = 1; line < runs[i].lines.size(); ++line) {
      if (runs[i].lines[line].stage == runs[i].lines[line - 1].stage) continue;
      const double begin = x(*std::max_element(iterations[i].begin(), iterations[i].begin() + line));
      svg +=
          lineTo(begin, top, begin, bottom, "stroke=\"" + color + "\" stroke-dasharray=\"3 4\" stroke-opacity=\"0.6\"");
    }
    std::string path;
    for (const auto& [px, py] : curves[i]) path += (path.empty() ? "M" : "L") + at(x(px)) + " " + at(y(py));
    if (!path.empty()) {
      svg += "<path d=\"" + path + "\" fill=\"none\" stroke=\"" + color + "\" stroke-width=\"1.5\"/>\n";
    }
    for (const auto& [px, py] : dots[i]) {
      svg += "<circle cx=\"" + at(x(px)) + "\" cy=\"" + at(y(py)) + "\" r=\"4\" fill=\"" + color +
             "\" stroke=\"white\"/>\n";
    }
  }
  return svg;
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
  const std::array<Panel, 3> panels = {
      Panel{"PSNR [dB]: line training, dots held out", [](const RunMetrics& line) { return line.train_psnr; },
            [](const RunMetrics& line) { return line.test_psnr; }},
      Panel{"loss of training", [](const RunMetrics& line) { return line.loss; }, {}},
      Panel{
          "Gaussians", [](const RunMetrics& line) { return std::optional(static_cast<double>(line.gaussians)); }, {}}};
  std::vector<std::vector<double>> iterations;
  double last = 1;
  for (const RunCurves& run : runs) {
    iterations.push_back(iterationsOfRun(run.lines));
    for (const double value : iterations.back()) last = std::max(last, value);
  }
  const double legend = 14 + kRow * static_cast<double>(runs.size());
  const double height = legend + 3 * (kPanel + kGap) + 26;
  std::string svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + at(kWidth) + "\" height=\"" + at(height) +
                    "\" viewBox=\"0 0 " + at(kWidth) + " " + at(height) +
                    "\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#23262d\">\n"
                    "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const double y = 20 + kRow * static_cast<double>(i);
    svg += lineTo(kLeft, y - 4, kLeft + 22, y - 4,
                  "stroke=\"" + std::string(kColors[i % kColors.size()]) + "\" stroke-width=\"3\"") +
           textAt(kLeft + 30, y, "start", escaped(runs[i].name) + outcome(runs[i]));
  }
  for (std::size_t i = 0; i < panels.size(); ++i) {
    svg += panelSvg(runs, iterations, panels[i], legend + 26 + static_cast<double>(i) * (kPanel + kGap), last);
  }
  svg += textAt(kWidth - kRight, height - 6, "end", "iterations of the run; dashed: a stage begins");
  return svg + "</svg>\n";
}

void addPlotOptions(CLI::App& app, PlotOptions& options) {
  app.add_option("runs", options.runs, "Run folders, or metrics.jsonl files")->required()->type_name("RUN");
  app.add_option("-o,--output", options.output, "Picture to write: .svg or .html")->required()->type_name("FILE");
  app.add_flag("--overwrite", options.overwrite, "Replace an existing file");
  app.add_flag("-q,--quiet", options.quiet, "Errors only");
  addExamples(app, {{"tgtrain plot run -o curves.svg", "the curves of a run"},
                    {"tgtrain plot run other-run -o curves.svg", "two runs beside each other"},
                    {"tgtrain plot run -o curves.html", "as a page"},
                    {"tgtrain plot run -o curves.svg --overwrite", "anew, of a run that goes on"},
                    {"tgtrain plot run/metrics.jsonl -o curves.svg", "of the file alone"}});
}

void plotRuns(const PlotOptions& options) {
  const std::string extension = options.output.extension().string();
  if (extension != ".svg" && extension != ".html") {
    throw Error(ErrorKind::usage, options.output.string(),
                "unknown format" + expectedFound(".svg or .html", extension));
  }
  refuseExisting(options.output.string(), options.overwrite);
  std::vector<RunCurves> runs;
  for (const fs::path& path : options.runs) runs.push_back(readRun(path));
  std::string text = curvesSvg(runs);
  if (extension == ".html") {
    text =
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>" + escaped(options.output.stem().string()) +
        "</title>\n<style>body { margin: 16px; } svg { max-width: 100%; height: auto; }</style>\n" + text + "</html>\n";
  }
  writeTextAtomically(options.output, text);
  if (options.quiet) return;
  std::printf("wrote %s: %zu run%s\n", options.output.c_str(), runs.size(), runs.size() == 1 ? "" : "s");
}

}  // namespace tg
