// SPDX-License-Identifier: Apache-2.0
// Charts: whole XML, the numbers where they belong, nothing that is no number.
#include "training/figures/chart.h"

#include <algorithm>
#include <limits>

#include "support/catch.h"

using namespace tg;

namespace {

std::size_t countOf(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

}  // namespace

TEST_CASE("a line chart has a line a series, a dot a value, gaps where there is no number, and escapes names") {
  const double none = std::numeric_limits<double>::infinity();
  const LineChart chart{
      "view", "PSNR [dB]", {"a<b", "c", "d"}, {{"one & two", {30, none, 31}}, {"other", {29, 28, 27}}}};
  const std::string svg = svgOf(chart);
  CHECK(countOf(svg, "<circle") == 5);
  CHECK_THAT(svg, Contains("one &amp; two, a&lt;b: 30.00"));
  CHECK_THAT(svg, !Contains("inf") && !Contains("nan"));
  CHECK(countOf(svg, "<svg") == countOf(svg, "</svg>"));
  CHECK(countOf(svg, "<title>") == countOf(svg, "</title>"));
  CHECK(svg == svgOf(chart));
}

TEST_CASE("charts of nothing, of one value and of equal values have axes") {
  const double none = std::numeric_limits<double>::infinity();
  for (const std::vector<double>& values : {std::vector<double>{none}, {30.0}, {30.0, 30.0}}) {
    const std::string svg =
        svgOf(LineChart{"view", "PSNR", std::vector<std::string>(values.size(), "v"), {{"m", values}}});
    CHECK_THAT(svg, Contains("class=\"axis\"") && !Contains("nan") && !Contains("inf"));
  }
  const std::string empty = svgOf(Histogram{"x", "y", 0, 1, {}, false, std::nullopt, {{"m", {0, 0, 0}}}});
  CHECK_THAT(empty, Contains("class=\"axis\"") && !Contains("nan"));
}

TEST_CASE("a histogram has ticks of its kind") {
  Histogram histogram{"sigma", "share", -4, 0.1, {}, true, std::nullopt, {{"m", std::vector<double>(20, 1.0)}}};
  CHECK_THAT(svgOf(histogram), Contains(">0.0001<") && Contains(">0.01<"));
  histogram = {"texels", "share", 0, 1, {"0", "1", "2", "4"}, false, std::nullopt, {{"m", {1, 2, 3, 4}}}};
  CHECK_THAT(svgOf(histogram), Contains(">4<"));
  histogram = {"dB", "views", -1, 0.1, {}, false, 0.0, {{"m", std::vector<double>(20, 1.0)}}};
  CHECK_THAT(svgOf(histogram), Contains("class=\"mark\"") && Contains(">-0.5<"));
}

TEST_CASE("curves below each other share their axis, have a line, dots and marks a label, and leave out a bad start") {
  CurvePoints line;
  for (int i = 0; i <= 300; ++i) line.emplace_back(10.0 * i, i == 0 ? 1e6 : 1 + i % 2);
  const CurveSheet sheet{"both",
                         "iterations",
                         {"a & b", "other"},
                         {{1000}, {}},
                         {{"first", {{line, {{500, 1.5}}}, {}}}, {"second", {{}, {line, {}}}}}};
  const std::string svg = svgOf(sheet);
  CHECK(countOf(svg, "class=\"line s0\"") == 2);  // the legend's, and one chart's
  CHECK(countOf(svg, "class=\"line s1\"") == 2);
  CHECK(countOf(svg, "class=\"mark s0\"") == 2);
  CHECK(countOf(svg, "<circle") == 1);
  CHECK(countOf(svg, ">2000</text>") == 2);
  CHECK(countOf(svg, ">iterations</text>") == 1);
  // The last number ends within the drawing: it is centred, in letters of at most 9 px.
  const std::size_t last = svg.find(">3000</text>"), begin = svg.rfind("<text x=\"", last);
  REQUIRE(begin != std::string::npos);
  CHECK(std::stod(svg.substr(begin + 9)) + 4 * 9.0 / 2 < 840);
  CHECK_THAT(svg, Contains(">a &amp; b<") && !Contains("nan") && !Contains(" M</text>"));
  const std::string empty = svgOf(CurveSheet{"none", "x", {"a"}, {{}}, {{"first", {{}}}}});
  CHECK_THAT(empty, Contains("class=\"axis\"") && !Contains("nan") && !Contains("inf"));
}

TEST_CASE("a chart of its own brings its colours, for light and dark") {
  const std::string svg = standaloneSvg(svgOf(LineChart{"x", "y", {"v"}, {{"m", {1}}}}));
  CHECK(svg.starts_with("<svg xmlns="));
  CHECK_THAT(svg, Contains("<rect class=\"page\"") && Contains(".chart .page{fill:"));
  CHECK_THAT(svg, Contains("prefers-color-scheme:dark") && Contains(".chart .line.s7,"));
  CHECK(seriesClass(0) == seriesClass(kSeriesColors));
}
