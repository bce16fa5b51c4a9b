// SPDX-License-Identifier: Apache-2.0
// SVG by hand, coloured by classes for light and dark pages.
#include "training/figures/drawing.h"

#include <algorithm>
#include <cmath>

#include "core/system/numbers.h"
#include "training/figures/report.h"

namespace tg {
namespace {

constexpr double kLeft = 58, kRight = 28, kBottom = 46, kTitle = 28;    // [px] around the axes
constexpr double kLegendRow = 20, kLetter = 7.4, kKey = 26, kGap = 16;  // a letter is about so wide
constexpr std::size_t kLongestLabel = 40;                               // [letters] where several share a row

bool begins(char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }  // of UTF-8

std::string cutLabel(const std::string& label, std::size_t most) {
  std::size_t letters = 0, end = 0;
  for (; end < label.size(); ++end) {
    if (begins(label[end]) && letters++ == most) break;
  }
  return end < label.size() ? label.substr(0, end) + "…" : label;
}

double lettersOf(const std::string& text) {
  return static_cast<double>(std::count_if(text.begin(), text.end(), begins));
}

}  // namespace

void Range::add(double value) {
  if (!std::isfinite(value)) return;
  low = std::min(low, value);
  high = std::max(high, value);
}

double roundStep(double span, double steps) {
  const double rough = span / steps, power = std::pow(10.0, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= rough) return factor * power;
  }
  return 10 * power;
}

std::vector<double> multiplesIn(const Axis& axis, double step) {
  constexpr int kMost = 1000;  // where numbers are so large that a step is nothing to them
  std::vector<double> values;
  const double first = std::ceil(axis.low / step - 1e-9);
  for (int i = 0; i < kMost && (first + i) * step <= axis.high + step * 1e-9; ++i) values.push_back((first + i) * step);
  return values;
}

std::string tickText(double value) {
  const double size = std::abs(value);
  if (size >= 1e6) return formatted("%.4g M", value / 1e6);
  if (size >= 1e4) return formatted("%.4g k", value / 1e3);
  return formatted("%.6g", size < 1e-12 ? 0.0 : value);
}

std::string place(double value) { return formatted("%.2f", value); }

void Drawing::legend(const std::vector<std::string>& labels, bool rows) {
  const auto most = rows ? static_cast<std::size_t>((width_ - kLeft - kKey - kRight) / kLetter) : kLongestLabel;
  double x = kLeft;
  next_ += kLegendRow;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const std::string label = cutLabel(labels[i], most);
    const double width = kKey + kLetter * lettersOf(label);
    if (x > kLeft && (rows || x + width > width_ - kRight)) {
      x = kLeft;
      next_ += kLegendRow;
    }
    const double y = next_ - kLegendRow + 6;
    line(i, "M" + place(x) + " " + place(y) + "h18");
    text(x + kKey - 2, y + 5, label);
    x += width + kGap;
  }
}

Axes Drawing::axes(double height, Range x, Range y, const AxesLabels& labels, double inset) {
  if (!labels.title.empty()) {
    next_ += kTitle;
    text(kLeft, next_ - 8, labels.title, " class=\"title\"");
  }
  const double right = width_ - kRight, top = next_, bottom = top + height;
  const Axes axes{{x.low, x.high, kLeft + inset, right - inset}, {y.low, y.high, bottom, top}};
  for (const double value : multiplesIn(axes.y, roundStep(y.high - y.low, 5))) {
    body_ +=
        "<path class=\"grid\" d=\"M" + place(kLeft) + " " + place(axes.y.at(value)) + "H" + place(right) + "\"/>\n";
    text(kLeft - 6, axes.y.at(value) + 5, tickText(value), " text-anchor=\"end\"");
  }
  body_ += "<path class=\"axis\" d=\"M" + place(kLeft) + " " + place(bottom) + "H" + place(right) + "\"/>\n";
  if (!labels.x.empty()) text((kLeft + right) / 2, bottom + 38, labels.x, " text-anchor=\"middle\"");
  if (!labels.y.empty()) {
    const double middle = (top + bottom) / 2;
    text(14, middle, labels.y, " text-anchor=\"middle\" transform=\"rotate(-90 14 " + place(middle) + ")\"");
  }
  next_ = bottom + (labels.x.empty() ? kBottom - kLegendRow : kBottom);
  return axes;
}

void Drawing::tick(const Axes& axes, double value, const std::string& words) {
  const double x = axes.x.at(value), bottom = axes.y.from;
  text(x, bottom + 18, words, " text-anchor=\"middle\"");
  body_ += "<path class=\"axis\" d=\"M" + place(x) + " " + place(bottom) + "v4\"/>\n";
}

void Drawing::roundTicks(const Axes& axes, double steps) {
  for (const double value : multiplesIn(axes.x, roundStep(axes.x.high - axes.x.low, steps))) {
    tick(axes, value, tickText(value));
  }
}

void Drawing::line(std::size_t series, const std::string& path) {
  body_ += "<path class=\"line " + seriesClass(series) + "\" d=\"" + path + "\"/>\n";
}

void Drawing::area(std::size_t series, const std::string& path) {
  body_ += "<path class=\"area " + seriesClass(series) + "\" d=\"" + path + "\"/>\n";
}

void Drawing::dot(std::size_t series, double x, double y, double radius, const std::string& tip) {
  body_ += "<circle class=\"" + seriesClass(series) + "\" cx=\"" + place(x) + "\" cy=\"" + place(y) + "\" r=\"" +
           formatted("%.6g", radius) + "\"" +
           (tip.empty() ? "/>\n" : "><title>" + htmlText(tip) + "</title></circle>\n");
}

void Drawing::mark(const Axes& axes, double value, const std::string& shade) {
  body_ += "<path class=\"mark" + (shade.empty() ? "" : " " + shade) + "\" d=\"M" + place(axes.x.at(value)) + " " +
           place(axes.y.to) + "V" + place(axes.y.from) + "\"/>\n";
}

void Drawing::text(double x, double y, const std::string& words, const std::string& attributes) {
  body_ += "<text x=\"" + place(x) + "\" y=\"" + place(y) + "\"" + attributes + ">" + htmlText(words) + "</text>\n";
}

std::string Drawing::svg(const std::string& title) const {
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" viewBox=\"0 0 " + formatted("%.6g", width_) + " " +
         formatted("%.6g", next_) + "\" role=\"img\">\n<title>" + htmlText(title) + "</title>\n" + body_ + "</svg>\n";
}

std::string seriesClass(std::size_t series) { return "s" + std::to_string(series % kSeriesColors); }

// Colours of Okabe & Ito (2008), told apart by most eyes, darker on white and lighter on black; dashes for print.
std::string svgStyle() {
  constexpr const char* kLight[kSeriesColors] = {"#0072b2", "#d55e00", "#009e73", "#a64b84",
                                                 "#8a6a00", "#2a8fc7", "#5b5bd6", "#666666"};
  constexpr const char* kDark[kSeriesColors] = {"#5cb3e6", "#ff8c42", "#2fcf9f", "#e08fbf",
                                                "#e6b800", "#8fd3ff", "#a5a5ff", "#b0b0b0"};
  constexpr const char* kDashes[kSeriesColors] = {"none", "7 3", "2 3", "9 3 2 3", "12 4", "4 4", "1 2", "14 3 3 3"};
  // No variables in a chart's own rules: programs that turn SVG into other formats do not know them.
  const auto rules = [](const char* ink, const char* page, const char* grid, const char* axis,
                        const char* const* colors) {
    std::string text = std::string(".chart text{fill:") + ink + "}\n.chart .page{fill:" + page +
                       "}\n.chart .grid{stroke:" + grid + "}\n.chart .axis,.chart .mark{stroke:" + axis + "}\n";
    for (std::size_t i = 0; i < kSeriesColors; ++i) {
      const std::string name = seriesClass(i), color = colors[i];
      text += "." + name + "{--c:" + color + "}\n.chart .line." + name + ",.chart .mark." + name + "{stroke:" + color +
              "}\n.chart .area." + name + ",.chart circle." + name + "{fill:" + color + "}\n";
    }
    return text;
  };
  std::string style =
      ".chart{max-width:100%;height:auto}\n.chart text{font:14px system-ui,sans-serif}\n.chart "
      ".title{font-weight:600}\n"
      ".chart path{fill:none}\n.chart .mark{stroke-dasharray:3 3}\n.chart .line{stroke-width:1.8}\n"
      ".chart .area{opacity:.16}\n";
  for (std::size_t i = 0; i < kSeriesColors; ++i) {
    style += ".chart .line." + seriesClass(i) + "{stroke-dasharray:" + kDashes[i] + "}\n";
  }
  return style + rules("#1b1f24", "#ffffff", "#d9dde3", "#5f6872", kLight) + "@media (prefers-color-scheme:dark){\n" +
         rules("#e4e7eb", "#16191d", "#353b43", "#9aa3ad", kDark) + "}\n";
}

std::string standaloneSvg(const std::string& svg) {
  const std::size_t end = svg.find('\n') + 1;
  return svg.substr(0, end) + "<style>\n" + svgStyle() +
         "</style>\n<rect class=\"page\" width=\"100%\" height=\"100%\"/>\n" + svg.substr(end);
}

}  // namespace tg
