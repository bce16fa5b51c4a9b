// SPDX-License-Identifier: Apache-2.0
// Charts from what drawing.h draws.
#include "training/figures/chart.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/run/curves.h"
#include "core/system/assert.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

constexpr double kWidth = 480, kHeight = 254;            // [px] of a drawing, and of its axes; letters are 14 high
constexpr double kSheetWidth = 840, kSheetHeight = 210;  // the same of curves below each other
constexpr std::size_t kMostDots = 120;                   // of a line; more hide it

Drawing drawingOf(const std::vector<Series>& series) {
  Drawing drawing(kWidth);
  std::vector<std::string> labels;
  for (const Series& one : series) labels.push_back(one.label);
  if (labels.size() > 1) drawing.legend(labels, false);
  return drawing;
}

void decadeTicks(Drawing& drawing, const Axes& axes) {
  const double step = std::max(1.0, std::ceil((axes.x.high - axes.x.low) / 6));
  for (double tick = std::ceil(axes.x.low - 1e-9); tick <= axes.x.high + 1e-9; tick += step) {
    drawing.tick(axes, tick, tickText(std::pow(10.0, tick)));
  }
}

Range rangeOf(const CurveChart& chart) {
  std::vector<double> lines, dots;
  for (const Curve& curve : chart.curves) {
    for (const auto& [x, y] : curve.line) lines.push_back(y);
    for (const auto& [x, y] : curve.dots) dots.push_back(y);
  }
  const auto range = rangeOfCurves(std::move(lines), dots);
  if (!range) return {0, 1};
  const auto [low, high] = withRoom(*range);
  return {low, high};
}

}  // namespace

std::string svgOf(const LineChart& chart) {
  Drawing drawing = drawingOf(chart.series);
  Range values;
  for (const Series& series : chart.series) {
    TG_ASSERT(series.values.size() == chart.names.size(), "a value for every place");
    for (const double value : series.values) values.add(value);
  }
  if (values.empty()) values = {0, 1};
  const double margin = std::max((values.high - values.low) * 0.06, 0.05);
  const auto last = static_cast<double>(std::max<std::size_t>(chart.names.size(), 2));
  const Axes axes = drawing.axes(kHeight, {1, last}, {values.low - margin, values.high + margin},
                                 {chart.x_label, chart.y_label, ""}, 8);
  const double step = std::max(1.0, roundStep(last - 1, 8));
  for (double tick = 1; tick <= static_cast<double>(chart.names.size());
       tick = tick == 1 && step > 1 ? step : tick + step) {
    drawing.tick(axes, tick, tickText(tick));
  }
  for (std::size_t s = 0; s < chart.series.size(); ++s) {
    const Series& series = chart.series[s];
    std::string path;
    bool gap = true;
    const auto eachValue = [&](const auto& draw) {
      for (std::size_t i = 0; i < series.values.size(); ++i) {
        if (std::isfinite(series.values[i])) {
          draw(i, axes.x.at(static_cast<double>(i + 1)), axes.y.at(series.values[i]));
        } else {
          gap = true;
        }
      }
    };
    eachValue([&](std::size_t, double x, double y) {
      path += (std::exchange(gap, false) ? "M" : "L") + place(x) + " " + place(y);
    });
    if (!path.empty()) drawing.line(s, path);
    if (series.values.size() > kMostDots) continue;
    eachValue([&](std::size_t i, double x, double y) {
      drawing.dot(s, x, y, 2.6, series.label + ", " + chart.names[i] + ": " + formatted("%.2f", series.values[i]));
    });
  }
  return drawing.svg(chart.y_label + " over " + chart.x_label);
}

std::string svgOf(const Histogram& histogram) {
  Drawing drawing = drawingOf(histogram.series);
  std::size_t bins = 0;
  double most = 0;
  for (const Series& series : histogram.series) {
    bins = std::max(bins, series.values.size());
    for (const double value : series.values) most = std::max(most, value);
  }
  TG_ASSERT(bins > 0, "a histogram has bins");
  const auto left = [&](std::size_t bin) { return histogram.first + histogram.width * static_cast<double>(bin); };
  const Axes axes = drawing.axes(kHeight, {histogram.first, left(bins)}, {0, most > 0 ? most * 1.05 : 1},
                                 {histogram.x_label, histogram.y_label, ""});
  if (!histogram.categories.empty()) {
    for (std::size_t bin = 0; bin < histogram.categories.size(); ++bin) {
      drawing.tick(axes, left(bin) + histogram.width / 2, histogram.categories[bin]);
    }
  } else if (histogram.decades) {
    decadeTicks(drawing, axes);
  } else {
    drawing.roundTicks(axes, 6);
  }
  for (std::size_t s = 0; s < histogram.series.size(); ++s) {
    const Series& series = histogram.series[s];
    std::string steps = "M" + place(axes.x.from) + " " + place(axes.y.at(0));
    for (std::size_t bin = 0; bin < series.values.size(); ++bin) {
      steps += "V" + place(axes.y.at(series.values[bin])) + "H" + place(axes.x.at(left(bin + 1)));
    }
    steps += "V" + place(axes.y.at(0));
    drawing.area(s, steps + "Z");
    drawing.line(s, steps);
  }
  if (histogram.mark && *histogram.mark >= axes.x.low && *histogram.mark <= axes.x.high) {
    drawing.mark(axes, *histogram.mark);
  }
  return drawing.svg(histogram.y_label + " over " + histogram.x_label);
}

std::string svgOf(const CurveSheet& sheet) {
  Drawing drawing(kSheetWidth);
  drawing.legend(sheet.labels, true);
  double last = 1;
  for (const CurveChart& chart : sheet.charts) {
    TG_ASSERT(chart.curves.size() == sheet.labels.size() && sheet.marks.size() == sheet.labels.size(),
              "curves and marks of every label");
    for (const Curve& curve : chart.curves) {
      for (const auto& [x, y] : curve.line) last = std::max(last, x);
      for (const auto& [x, y] : curve.dots) last = std::max(last, x);
    }
  }
  for (const CurveChart& chart : sheet.charts) {
    const bool lowest = &chart == &sheet.charts.back();
    const Range range = rangeOf(chart);
    const Axes axes = drawing.axes(kSheetHeight, {0, last}, range, {lowest ? sheet.x_label : "", "", chart.title});
    const auto y = [&](double value) { return axes.y.at(std::clamp(value, range.low, range.high)); };
    drawing.roundTicks(axes, 8);
    for (std::size_t s = 0; s < chart.curves.size(); ++s) {
      for (const double mark : sheet.marks[s]) drawing.mark(axes, mark, seriesClass(s));
      std::string path;
      for (const auto& [px, py] : chart.curves[s].line) {
        path += (path.empty() ? "M" : "L") + place(axes.x.at(px)) + " " + place(y(py));
      }
      if (!path.empty()) drawing.line(s, path);
      for (const auto& [px, py] : chart.curves[s].dots) drawing.dot(s, axes.x.at(px), y(py), 4);
    }
  }
  return drawing.svg(sheet.title);
}

}  // namespace tg
