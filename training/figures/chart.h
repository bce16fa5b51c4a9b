// SPDX-License-Identifier: Apache-2.0
// Charts as SVG, of a few series each, for light and dark pages.
#pragma once
#include <optional>
#include <string>
#include <vector>

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

// The style of what svgOf() returns: a page holds it once, a file of its own between its tags.
std::string svgStyle();
std::string standaloneSvg(const std::string& svg);

// The colour of a series as CSS: the same in every chart and table.
std::string seriesClass(std::size_t series);
constexpr std::size_t kSeriesColors = 8;

}  // namespace tg
