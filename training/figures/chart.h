// SPDX-License-Identifier: Apache-2.0
// Charts as SVG, of a few series each, for light and dark pages.
#pragma once
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "training/figures/drawing.h"

namespace tg {

struct Series {
  std::string label;
  std::vector<double> values;
};

struct LineChart {
  std::string x_label, y_label;
  std::vector<std::string> names;  // of the places along x, for the pointer
  std::vector<Series> series;      // a value a place; not finite: a gap
};
std::string svgOf(const LineChart& chart);

// Bins of one width, or of one category each.
struct Histogram {
  std::string x_label, y_label;
  double first = 0, width = 1;          // left end of the first bin
  std::vector<std::string> categories;  // one a bin, instead of numbers; may be empty
  bool decades = false;                 // x is a power of ten
  std::optional<double> mark;           // a vertical line
  std::vector<Series> series;           // a value a bin
};
std::string svgOf(const Histogram& histogram);

// Curves over a number from 0 on, one chart below the other over one axis.
using CurvePoints = std::vector<std::pair<double, double>>;
struct Curve {
  CurvePoints line, dots;  // in order, finite
};
struct CurveChart {
  std::string title;
  std::vector<Curve> curves;  // one a label
};
struct CurveSheet {
  std::string title, x_label;
  std::vector<std::string> labels;
  std::vector<std::vector<double>> marks;  // vertical lines of every label
  std::vector<CurveChart> charts;
};
std::string svgOf(const CurveSheet& sheet);

}  // namespace tg
