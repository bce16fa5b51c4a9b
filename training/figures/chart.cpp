// SPDX-License-Identifier: Apache-2.0
// SVG by hand: axes with round numbers, lines, steps, a legend.
#include "training/figures/chart.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/system/assert.h"
#include "core/system/numbers.h"
#include "training/figures/report.h"

namespace tg {
namespace {

constexpr double kWidth = 480, kHeight = 300;                           // of the drawing; letters are 14 high
constexpr double kLeft = 58, kRight = 14, kBottom = 46;                 // around the axes
constexpr double kLegendRow = 20, kLetter = 7.4, kKey = 26, kGap = 16;  // a letter is about so wide
constexpr std::size_t kLongestLabel = 40;                               // [letters]
constexpr std::size_t kMostDots = 120;                                  // of a line; more hide it

std::string shortened(const std::string& label) {
  std::size_t letters = 0, end = 0;
  for (; end < label.size(); ++end) {
    const bool begins = (static_cast<unsigned char>(label[end]) & 0xC0) != 0x80;
    if (begins && letters++ == kLongestLabel) break;
  }
  return end < label.size() ? label.substr(0, end) + "…" : label;
}

double lettersOf(const std::string& text) {
  return static_cast<double>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

std::string number(double value) {
  if (value == 0) value = 0;  // no -0
  return formatted("%.6g", value);
}
std::string place(double value) { return formatted("%.2f", value); }

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
  void add(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  bool empty() const { return low > high; }
};

// 1, 2 or 5 times a power of ten, for about so many steps.
double roundStep(double span, double steps) {
  const double rough = span / steps, power = std::pow(10.0, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= rough) return factor * power;
  }
  return 10 * power;
}

// Where numbers lie on the drawing.
struct Axis {
  double low, high, from, to;
  double at(double value) const { return from + (value - low) / (high - low) * (to - from); }
};

class Drawing {
 public:
  explicit Drawing(const std::vector<Series>& series) {
    double x = kLeft;
    top_ = 12;
    if (series.size() > 1) {
      top_ += kLegendRow;
      for (std::size_t i = 0; i < series.size(); ++i) {
        const std::string label = shortened(series[i].label);
        const double width = kKey + kLetter * lettersOf(label);
        if (x > kLeft && x + width > kWidth - kRight) {
          x = kLeft;
          top_ += kLegendRow;
        }
        const double y = top_ - kLegendRow + 6;
        body_ += "<path class=\"line " + seriesClass(i) + "\" d=\"M" + place(x) + " " + place(y) + "h18\"/>\n";
        text(x + kKey - 2, y + 5, label, "");
        x += width + kGap;
      }
    }
  }

  double top() const { return top_; }
  double bottom() const { return top_ + kHeight - kBottom; }
  double height() const { return top_ + kHeight; }

  void add(const std::string& svg) { body_ += svg; }
  void text(double x, double y, const std::string& words, const std::string& attributes) {
    body_ += "<text x=\"" + place(x) + "\" y=\"" + place(y) + "\"" + attributes + ">" + htmlText(words) + "</text>\n";
  }
  void frame(const Axis& x, const Axis& y, const std::string& x_label, const std::string& y_label) {
    const double step = roundStep(y.high - y.low, 5);
    for (double tick = std::ceil(y.low / step - 1e-9) * step; tick <= y.high + step * 1e-9; tick += step) {
      body_ += "<path class=\"grid\" d=\"M" + place(x.from) + " " + place(y.at(tick)) + "H" + place(x.to) + "\"/>\n";
      text(x.from - 6, y.at(tick) + 5, number(std::round(tick / step) * step), " text-anchor=\"end\"");
    }
    body_ += "<path class=\"axis\" d=\"M" + place(x.from) + " " + place(y.from) + "H" + place(x.to) + "\"/>\n";
    text((x.from + x.to) / 2, y.from + 38, x_label, " text-anchor=\"middle\"");
    const double middle = (y.from + y.to) / 2;
    text(14, middle, y_label, " text-anchor=\"middle\" transform=\"rotate(-90 14 " + place(middle) + ")\"");
  }
  void tick(double x, const std::string& words) {
    text(x, bottom() + 18, words, " text-anchor=\"middle\"");
    body_ += "<path class=\"axis\" d=\"M" + place(x) + " " + place(bottom()) + "v4\"/>\n";
  }
  std::string svg(const std::string& title) const {
    return "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" viewBox=\"0 0 " + number(kWidth) + " " +
           number(height()) + "\" role=\"img\">\n<title>" + htmlText(title) + "</title>\n" + body_ + "</svg>\n";
  }

 private:
  double top_ = 0;
  std::string body_;
};

void numberTicks(Drawing& drawing, const Axis& x) {
  const double step = roundStep(x.high - x.low, 6);
  for (double tick = std::ceil(x.low / step - 1e-9) * step; tick <= x.high + step * 1e-9; tick += step) {
    drawing.tick(x.at(tick), number(std::round(tick / step) * step));
  }
}

void decadeTicks(Drawing& drawing, const Axis& x) {
  const double step = std::max(1.0, std::ceil((x.high - x.low) / 6));
  for (double tick = std::ceil(x.low - 1e-9); tick <= x.high + 1e-9; tick += step) {
    drawing.tick(x.at(tick), number(std::pow(10.0, tick)));
  }
}

}  // namespace

std::string seriesClass(std::size_t series) { return "s" + std::to_string(series % kSeriesColors); }

std::string svgOf(const LineChart& chart) {
  Drawing drawing(chart.series);
  Range values;
  for (const Series& series : chart.series) {
    TG_ASSERT(series.values.size() == chart.names.size(), "a value for every place");
    for (const double value : series.values) values.add(value);
  }
  if (values.empty()) values = {0, 1};
  const double margin = std::max((values.high - values.low) * 0.06, 0.05);
  const auto last = static_cast<double>(std::max<std::size_t>(chart.names.size(), 2));
  const Axis x{1, last, kLeft + 8, kWidth - kRight - 8};
  const Axis y{values.low - margin, values.high + margin, drawing.bottom(), drawing.top()};
  drawing.frame({1, last, kLeft, kWidth - kRight}, y, chart.x_label, chart.y_label);
  const double step = std::max(1.0, roundStep(last - 1, 8));
  for (double tick = 1; tick <= static_cast<double>(chart.names.size());
       tick = tick == 1 && step > 1 ? step : tick + step) {
    drawing.tick(x.at(tick), number(tick));
  }
  for (std::size_t s = 0; s < chart.series.size(); ++s) {
    const Series& series = chart.series[s];
    std::string path, dots;
    bool gap = true;
    for (std::size_t i = 0; i < series.values.size(); ++i) {
      const double value = series.values[i];
      if (!std::isfinite(value)) {
        gap = true;
        continue;
      }
      const std::string px = place(x.at(static_cast<double>(i + 1))), py = place(y.at(value));
      path += (gap ? "M" : "L") + px + " " + py;
      gap = false;
      if (series.values.size() > kMostDots) continue;
      dots += "<circle class=\"" + seriesClass(s) + "\" cx=\"" + px + "\" cy=\"" + py + "\" r=\"2.6\"><title>" +
              htmlText(series.label + ", " + chart.names[i] + ": " + formatted("%.2f", value)) + "</title></circle>\n";
    }
    if (!path.empty()) drawing.add("<path class=\"line " + seriesClass(s) + "\" d=\"" + path + "\"/>\n");
    drawing.add(dots);
  }
  return drawing.svg(chart.y_label + " over " + chart.x_label);
}

std::string svgOf(const Histogram& histogram) {
  Drawing drawing(histogram.series);
  std::size_t bins = 0;
  double most = 0;
  for (const Series& series : histogram.series) {
    bins = std::max(bins, series.values.size());
    for (const double value : series.values) most = std::max(most, value);
  }
  TG_ASSERT(bins > 0, "a histogram has bins");
  const Axis x{histogram.first, histogram.first + histogram.width * static_cast<double>(bins), kLeft, kWidth - kRight};
  const Axis y{0, most > 0 ? most * 1.05 : 1, drawing.bottom(), drawing.top()};
  drawing.frame(x, y, histogram.x_label, histogram.y_label);
  const auto edge = [&](std::size_t bin) { return x.at(histogram.first + histogram.width * static_cast<double>(bin)); };
  if (!histogram.categories.empty()) {
    for (std::size_t bin = 0; bin < histogram.categories.size(); ++bin) {
      drawing.tick((edge(bin) + edge(bin + 1)) / 2, histogram.categories[bin]);
    }
  } else if (histogram.decades) {
    decadeTicks(drawing, x);
  } else {
    numberTicks(drawing, x);
  }
  for (std::size_t s = 0; s < histogram.series.size(); ++s) {
    const Series& series = histogram.series[s];
    std::string steps = "M" + place(edge(0)) + " " + place(y.at(0));
    for (std::size_t bin = 0; bin < series.values.size(); ++bin) {
      steps += "V" + place(y.at(series.values[bin])) + "H" + place(edge(bin + 1));
    }
    steps += "V" + place(y.at(0));
    drawing.add("<path class=\"area " + seriesClass(s) + "\" d=\"" + steps + "Z\"/>\n<path class=\"line " +
                seriesClass(s) + "\" d=\"" + steps + "\"/>\n");
  }
  if (histogram.mark && *histogram.mark >= x.low && *histogram.mark <= x.high) {
    drawing.add("<path class=\"mark\" d=\"M" + place(x.at(*histogram.mark)) + " " + place(drawing.top()) + "V" +
                place(drawing.bottom()) + "\"/>\n");
  }
  return drawing.svg(histogram.y_label + " over " + histogram.x_label);
}

// Colours of Okabe & Ito (2008), told apart by most eyes, darker on white and lighter on black; dashes for print.
std::string svgStyle() {
  constexpr const char* kLight[kSeriesColors] = {"#0072b2", "#d55e00", "#009e73", "#a64b84",
                                                 "#8a6a00", "#2a8fc7", "#5b5bd6", "#666666"};
  constexpr const char* kDark[kSeriesColors] = {"#5cb3e6", "#ff8c42", "#2fcf9f", "#e08fbf",
                                                "#e6b800", "#8fd3ff", "#a5a5ff", "#b0b0b0"};
  constexpr const char* kDashes[kSeriesColors] = {"none", "7 3", "2 3", "9 3 2 3", "12 4", "4 4", "1 2", "14 3 3 3"};
  // No variables in a chart's own rules: programs that turn SVG into other formats do not know them.
  const auto rules = [](const char* ink, const char* grid, const char* axis, const char* const* colors) {
    std::string text = std::string(".chart text{fill:") + ink + "}\n.chart .grid{stroke:" + grid +
                       "}\n.chart .axis,.chart .mark{stroke:" + axis + "}\n";
    for (std::size_t i = 0; i < kSeriesColors; ++i) {
      const std::string name = seriesClass(i), color = colors[i];
      text += "." + name + "{--c:" + color + "}\n.chart .line." + name + "{stroke:" + color + "}\n.chart .area." +
              name + ",.chart circle." + name + "{fill:" + color + "}\n";
    }
    return text;
  };
  std::string style =
      ".chart{max-width:100%;height:auto}\n.chart text{font:14px system-ui,sans-serif}\n"
      ".chart path{fill:none}\n.chart .mark{stroke-dasharray:3 3}\n.chart .line{stroke-width:1.8}\n"
      ".chart .area{opacity:.16}\n";
  for (std::size_t i = 0; i < kSeriesColors; ++i) {
    style += ".chart .line." + seriesClass(i) + "{stroke-dasharray:" + kDashes[i] + "}\n";
  }
  return style + rules("#1b1f24", "#d9dde3", "#5f6872", kLight) + "@media (prefers-color-scheme:dark){\n" +
         rules("#e4e7eb", "#353b43", "#9aa3ad", kDark) + "}\n";
}

std::string standaloneSvg(const std::string& svg) {
  const std::size_t end = svg.find('\n') + 1;
  return svg.substr(0, end) + "<style>\n" + svgStyle() + "</style>\n" + svg.substr(end);
}

}  // namespace tg
