// SPDX-License-Identifier: Apache-2.0
// What charts are drawn from: axes with round numbers, lines, dots, marks, a legend.
#pragma once
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace tg {

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
  void add(double value);  // what is no number is none
  bool empty() const { return low > high; }
};

// Where numbers lie on the drawing [px].
struct Axis {
  double low, high, from, to;
  double at(double value) const { return from + (value - low) / (high - low) * (to - from); }
};

struct Axes {
  Axis x, y;
};

struct AxesLabels {
  std::string x, y;   // below, and upright on the left
  std::string title;  // above
};

// 1, 2 or 5 times a power of ten, for about so many steps.
double roundStep(double span, double steps);
// Multiples of it within the axis.
std::vector<double> multiplesIn(const Axis& axis, double step);
std::string tickText(double value);
// Of a place [px].
std::string place(double value);

// From the top to the bottom: legend, then axes, one below the other.
class Drawing {
 public:
  explicit Drawing(double width) : width_(width) {}

  // As many entries in a row as it holds, or one.
  void legend(const std::vector<std::string>& labels, bool rows);
  // The y axis with its numbers, the line of the x axis without; `inset` keeps that much free at both of its ends.
  Axes axes(double height, Range x, Range y, const AxesLabels& labels, double inset = 0);
  void tick(const Axes& axes, double value, const std::string& words);
  void roundTicks(const Axes& axes, double steps);

  void line(std::size_t series, const std::string& path);
  void area(std::size_t series, const std::string& path);
  void dot(std::size_t series, double x, double y, double radius, const std::string& tip = "");
  // A vertical line over the height of the axes, in the colour of `shade`: "" or a series' class.
  void mark(const Axes& axes, double value, const std::string& shade = "");
  std::string svg(const std::string& title) const;

 private:
  void text(double x, double y, const std::string& words, const std::string& attributes = "");

  const double width_;
  double next_ = 12;  // [px] from the top: what comes next begins there
  std::string body_;
};

// The colour of a series as CSS: the same in every chart and table.
std::string seriesClass(std::size_t series);
constexpr std::size_t kSeriesColors = 8;

// The style of what Drawing::svg() returns: a page holds it once, a file of its own between its tags.
std::string svgStyle();
std::string standaloneSvg(const std::string& svg);

}  // namespace tg
