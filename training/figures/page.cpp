// SPDX-License-Identifier: Apache-2.0
// The page: no script, nothing from elsewhere, light and dark, narrow and wide.
#include <cmath>

#include "core/system/numbers.h"
#include "training/figures/chart.h"
#include "training/figures/report.h"

namespace tg {
namespace {

constexpr const char* kStyle =
    R"(:root{color-scheme:light dark;--page:#fff;--card:#f5f6f8;--line:#d9dde3;--text:#1b1f24;--soft:#5f6872}
@media (prefers-color-scheme:dark){:root{--page:#14171b;--card:#1d2126;--line:#353b43;--text:#e4e7eb;--soft:#9aa3ad}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:1120px;padding:16px;background:var(--page);color:var(--text);font:16px/1.45 system-ui,sans-serif;overflow-wrap:anywhere}
h1{font-size:1.5rem;margin:.4em 0}h2{font-size:1.2rem;margin:2em 0 .6em}h3{font-size:1rem;margin:1.4em 0 .5em}
p,figcaption,.soft{color:var(--soft)}
.wide{overflow-x:auto;border:1px solid var(--line);border-radius:6px}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{padding:6px 10px;text-align:right;white-space:nowrap;border-top:1px solid var(--line)}
thead th{border-top:0;color:var(--soft);font-weight:600}
th:first-child{text-align:left;position:sticky;left:0;background:var(--page);max-width:44vw;overflow:hidden;text-overflow:ellipsis}
tr.set th{background:var(--card)}tr.set th,tr.set td{background:var(--card);text-align:left}
tr.part th{font-weight:400;padding-left:26px;color:var(--soft)}
.key{display:inline-block;width:.75em;height:.75em;border-radius:2px;margin-right:.45em;background:var(--c)}
.best{font-weight:700}
.charts{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,440px),1fr));gap:16px}
figure{margin:0}.charts figure{background:var(--card);border-radius:6px;padding:10px}
.chart{width:100%}
figcaption{font-size:.9rem}figcaption b{color:var(--text)}
.crop{background:var(--card);border-radius:6px;padding:10px;margin:0 0 16px}
.cells{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(45%,170px),1fr));gap:10px}
.cells img{width:100%;display:block;image-rendering:pixelated;border-radius:3px}
.cells .view{image-rendering:auto}
.cells figcaption+img{margin-top:8px}
)";

std::string table(const std::string& class_name, const std::string& cell) {
  return "<td" + (class_name.empty() ? "" : " class=\"" + class_name + "\"") + ">" + cell + "</td>";
}

std::string shownDecibels(double value) { return std::isinf(value) ? "∞" : decibels(value, 2); }

// The best of the models' full pictures in that metric, where there are several.
template <typename Metric>
double bestOf(const ReportedDataset& dataset, const Metric& metric, bool high) {
  double best = std::nan("");
  if (dataset.models.size() < 2) return best;
  for (const ReportedModel& model : dataset.models) {
    const double value = metric(meanView(model.full));
    if (std::isnan(best) || (high ? value > best : value < best)) best = value;
  }
  return best;
}

std::string resultsTable(const EvalComparison& report) {
  const bool lpips = !report.lpips.empty();
  std::string html =
      "<div "
      "class=\"wide\"><table>\n<thead><tr><th>Model</th><th>PSNR&nbsp;↑</th><th>SSIM&nbsp;↑</th><th>FLIP&nbsp;↓</th>";
  if (lpips) html += "<th>LPIPS&nbsp;↓</th>";
  html += "<th>Gaussians</th><th>Texels</th><th>Parameters</th><th>Bytes</th></tr></thead>\n<tbody>\n";
  const auto psnr = [](const ViewScore& s) { return s.psnr; };
  const auto ssim = [](const ViewScore& s) { return s.ssim; };
  const auto flip = [](const ViewScore& s) { return s.flip.value_or(0); };
  const auto perceptual = [](const ViewScore& s) { return s.lpips.value_or(0); };
  const ReportedDataset* last = nullptr;
  std::size_t index = 0;
  for (const ReportRow& row : rowsOf(report)) {
    const ReportedDataset& dataset = row.dataset;
    const bool full = std::string_view(row.part) == "full";
    if (last != &dataset) {
      html += "<tr class=\"set\"><th>" + htmlText(dataset.name) + "</th><td colspan=\"" + (lpips ? "8" : "7") + "\">" +
              htmlText(dataset.split) + " split, " + std::to_string(row.model.full.size()) + " views" +
              (row.model.full.size() < dataset.asked ? " of " + std::to_string(dataset.asked) + ": interrupted" : "") +
              "</td></tr>\n";
      last = &dataset;
      index = 0;
    }
    const auto cell = [&](const auto& metric, bool high, const std::string& text) {
      return table(full && metric(row.mean) == bestOf(dataset, metric, high) ? "best" : "", text);
    };
    html += full ? "<tr><th><span class=\"key " + seriesClass(index++) + "\"></span>" + htmlText(row.model.label)
                 : "<tr class=\"part\"><th>" + std::string(row.part);
    html += "</th>" + cell(psnr, true, shownDecibels(row.mean.psnr)) +
            cell(ssim, true, formatted("%.4f", row.mean.ssim)) + cell(flip, false, formatted("%.4f", flip(row.mean)));
    if (lpips) html += cell(perceptual, false, row.mean.lpips ? formatted("%.4f", *row.mean.lpips) : "");
    const ModelNumbers& n = row.model.numbers;
    for (const std::uintmax_t number :
         {std::uintmax_t{n.gaussians}, std::uintmax_t{n.texels}, std::uintmax_t{n.parameters}, n.bytes}) {
      html += table("", full ? grouped(number, "&#8239;") : "");
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

std::string image(const std::string& name, const std::string& alternative, const char* class_name = "") {
  return "<img loading=\"lazy\"" + (*class_name ? " class=\"" + std::string(class_name) + "\"" : "") + " src=\"" +
         name + "\" alt=\"" + htmlText(alternative) + "\">";
}

std::string cropSection(const ReportedDataset& dataset, std::size_t d, std::size_t c) {
  const Crop& crop = dataset.crops[c];
  const std::string view = displayText(crop.view);
  std::string html = "<div class=\"crop\"><h3>" + htmlText(view) + "</h3>\n<p>" + std::to_string(crop.box.size.x) +
                     " × " + std::to_string(crop.box.size.y) + " px at " + std::to_string(crop.box.corner.x) + ", " +
                     std::to_string(crop.box.corner.y) + (crop.asked ? ", as asked for" : "") + "; " +
                     (dataset.models.size() > 1 ? "FLIP errors differ by " : "FLIP error ") +
                     formatted("%.3f", crop.difference) + " in the mean</p>\n<div class=\"cells\">\n";
  const auto figure = [&](const std::string& what, const std::string& caption, const char* class_name = "") {
    html += "<figure>" + image(cropName(d, c, what), caption, class_name) + "<figcaption>" + caption +
            "</figcaption></figure>\n";
  };
  figure("view", "the view", "view");
  figure("photograph", "photograph");
  for (std::size_t m = 0; m < dataset.models.size(); ++m) {
    const std::string& label = dataset.models[m].label;
    html += "<figure>" + image(cropName(d, c, "model-" + std::to_string(m + 1)), label) +
            "<figcaption><span class=\"key " + seriesClass(m) + "\"></span>" + htmlText(label) + "</figcaption>" +
            image(cropName(d, c, "flip-" + std::to_string(m + 1)), "FLIP of " + label) + "<figcaption>FLIP " +
            formatted("%.3f", flip(crop.errors[m])) + "</figcaption></figure>\n";
  }
  return html + "</div></div>\n";
}

std::string definitions(const EvalComparison& report) {
  std::string html =
      "<h2>What the numbers are</h2>\n<p>PSNR [dB] of pictures rounded to 8 bit, SSIM with an 11 × 11 "
      "Gaussian window, FLIP at " +
      formatted("%.4g", report.flip_pixels_per_degree) + " pixels per degree";
  if (!report.lpips.empty()) html += ", LPIPS " + htmlText(report.lpips);
  html +=
      ", each the mean over the views. <i>base only</i> is the picture without what the textures add to its colour, "
      "<i>texture only</i> that alone, over black: the two add up to the picture. Parameters are the numbers that "
      "training chose, bytes those of the model's file. The same numbers: <a href=\"results.csv\">results.csv</a>, "
      "<a href=\"views.csv\">views.csv</a>, <a href=\"table.tex\">table.tex</a>; the charts are .svg files beside "
      "this page.</p>\n";
  return html;
}

}  // namespace

std::string htmlText(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      case '\'':
        result += "&#39;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string cropName(std::size_t dataset, std::size_t crop, const std::string& what) {
  return "crops/" + std::to_string(dataset + 1) + "-" + std::to_string(crop + 1) + "-" + what + ".png";
}

std::string formatPage(const EvalComparison& report, const std::vector<PageChart>& charts) {
  std::string title = "Models against photographs: ";
  for (std::size_t d = 0; d < report.datasets.size(); ++d) title += (d > 0 ? ", " : "") + report.datasets[d].name;
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>" +
      htmlText(title) + "</title>\n<style>\n" + kStyle + svgStyle() + "</style></head>\n<body>\n<h1>" +
      htmlText(title) + "</h1>\n" + resultsTable(report);
  for (std::size_t d = 0; d < report.datasets.size(); ++d) {
    const ReportedDataset& dataset = report.datasets[d];
    html += "<h2>" + htmlText(dataset.name) + "</h2>\n<div class=\"charts\">\n";
    for (const PageChart& chart : charts) {
      if (chart.dataset != d) continue;
      html += "<figure><figcaption><b>" + htmlText(chart.title) + "</b><br>" + htmlText(chart.note) +
              "</figcaption>\n" + chart.svg + "</figure>\n";
    }
    html += "</div>\n";
    if (dataset.crops.empty()) continue;
    html += "<h2>" + htmlText(dataset.name) +
            ": crops</h2>\n<p>FLIP error from black (0) over violet and orange to light yellow (1).</p>\n";
    for (std::size_t c = 0; c < dataset.crops.size(); ++c) html += cropSection(dataset, d, c);
  }
  return html + definitions(report) + "</body></html>\n";
}

}  // namespace tg
