// SPDX-License-Identifier: Apache-2.0
// Rows, charts and pictures of a report as its files.
#include "training/figures/report.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <span>

#include "core/file/json.h"
#include "core/image/color_map.h"
#include "core/image/drawn.h"
#include "core/system/error.h"
#include "training/figures/chart.h"
#include "training/score/eval_report.h"

namespace tg {
namespace {

constexpr int kDifferenceBins = 20;

std::vector<std::uint8_t> bytesOf(const std::string& text) { return {text.begin(), text.end()}; }

std::string viewsNote(const ReportedDataset& dataset) {
  return dataset.name + ", " + dataset.split + " split, " + std::to_string(dataset.models.front().full.size()) +
         " views";
}

LineChart psnrCurves(const ReportedDataset& dataset) {
  LineChart chart{"view", "PSNR [dB]", {}, {}};
  for (const ViewScore& view : dataset.models.front().full) chart.names.push_back(displayText(view.name));
  for (const ReportedModel& model : dataset.models) {
    Series series{model.label, {}};
    for (const ViewScore& view : model.full) series.values.push_back(view.psnr);
    chart.series.push_back(std::move(series));
  }
  return chart;
}

// Of every other model less the first one; none where there is no other.
std::optional<Histogram> psnrDifferences(const ReportedDataset& dataset) {
  const ReportedModel& first = dataset.models.front();
  std::vector<std::vector<double>> all;
  double most = 0;
  for (const ReportedModel& model : std::span(dataset.models).subspan(1)) {
    std::vector<double>& differences = all.emplace_back();
    for (std::size_t i = 0; i < model.full.size(); ++i) {
      const double difference = model.full[i].psnr - first.full[i].psnr;
      if (!std::isfinite(difference)) continue;
      differences.push_back(difference);
      most = std::max(most, std::abs(difference));
    }
  }
  if (all.empty()) return std::nullopt;
  // Round bins on both sides of 0.
  double step = 0.01;
  for (int i = 0; step * kDifferenceBins / 2 < most; ++i) step *= i % 3 == 1 ? 2.5 : 2;
  const double lowest = -step * kDifferenceBins / 2;
  Histogram histogram{"PSNR less that of " + first.label + " [dB]", "views", lowest, step, {}, false, 0.0, {}};
  // An empty series holds the first one's colour.
  histogram.series.push_back({first.label + " (0)", std::vector<double>(kDifferenceBins)});
  for (std::size_t m = 0; m < all.size(); ++m) {
    Series series{dataset.models[m + 1].label, std::vector<double>(kDifferenceBins)};
    for (const double difference : all[m]) {
      const int bin = std::clamp(static_cast<int>(std::floor((difference - lowest) / step)), 0, kDifferenceBins - 1);
      ++series.values[static_cast<std::size_t>(bin)];
    }
    histogram.series.push_back(std::move(series));
  }
  return histogram;
}

// Of bins [begin, end) of each model, as shares of all.
std::vector<Series> shares(const ReportedDataset& dataset, std::size_t begin, std::size_t end,
                           const std::function<std::span<const std::size_t>(const ModelNumbers&)>& bins) {
  std::vector<Series> result;
  for (const ReportedModel& model : dataset.models) {
    const std::span<const std::size_t> counts = bins(model.numbers);
    double total = 0;
    for (const std::size_t count : counts) total += static_cast<double>(count);
    Series series{model.label, {}};
    for (std::size_t bin = begin; bin < end; ++bin) {
      series.values.push_back(100 * static_cast<double>(counts[bin]) / std::max(total, 1.0));
    }
    result.push_back(std::move(series));
  }
  return result;
}

// The bins that some model fills, with one beside them where there is one.
std::pair<std::size_t, std::size_t> filled(const ReportedDataset& dataset, std::size_t bins,
                                           const std::function<std::span<const std::size_t>(const ModelNumbers&)>& of) {
  std::size_t begin = bins, end = 0;
  for (const ReportedModel& model : dataset.models) {
    for (std::size_t bin = 0; bin < bins; ++bin) {
      if (of(model.numbers)[bin] == 0) continue;
      begin = std::min(begin, bin);
      end = std::max(end, bin + 1);
    }
  }
  if (begin >= end) return {0, bins};
  return {begin > 0 ? begin - 1 : 0, std::min(end + 1, bins)};
}

constexpr const char* kShare = "share of Gaussians [%]";

Histogram opacities(const ReportedDataset& dataset) {
  return {"opacity",
          kShare,
          0,
          1.0 / ModelNumbers::kOpacityBins,
          {},
          false,
          std::nullopt,
          shares(dataset, 0, ModelNumbers::kOpacityBins,
                 [](const ModelNumbers& n) { return std::span<const std::size_t>(n.opacity); })};
}

Histogram scales(const ReportedDataset& dataset) {
  const auto bins = [](const ModelNumbers& n) { return std::span<const std::size_t>(n.scale); };
  const auto [begin, end] = filled(dataset, ModelNumbers::kScaleBins, bins);
  return {"sigma [world units]",
          "share of axes [%]",
          ModelNumbers::kLowestScale + ModelNumbers::kScaleStep * static_cast<double>(begin),
          ModelNumbers::kScaleStep,
          {},
          true,
          std::nullopt,
          shares(dataset, begin, end, bins)};
}

Histogram ranks(const ReportedDataset& dataset) {
  return {"effective rank: 1 needle, 2 disc, 3 ball",
          kShare,
          1,
          2.0 / EffectiveRanks::kBins,
          {},
          false,
          std::nullopt,
          shares(dataset, 0, EffectiveRanks::kBins,
                 [](const ModelNumbers& n) { return std::span<const std::size_t>(n.ranks.bins); })};
}

Histogram texelCounts(const ReportedDataset& dataset) {
  const auto bins = [](const ModelNumbers& n) { return std::span<const std::size_t>(n.texel_counts); };
  const std::size_t end = std::max<std::size_t>(filled(dataset, ModelNumbers::kTexelBins, bins).second, 4);
  Histogram histogram{"texels, up to twice as many a bin", kShare, 0, 1, {}, false, std::nullopt,
                      shares(dataset, 0, end, bins)};
  for (std::size_t bin = 0; bin < end; ++bin) {
    const std::size_t least = bin == 0 ? 0 : std::size_t{1} << (bin - 1);
    histogram.categories.push_back(least < 1024 ? std::to_string(least) : std::to_string(least / 1024) + "k");
  }
  return histogram;
}

void addCrops(const EvalComparison& report, std::vector<ReportFile>& files) {
  for (std::size_t d = 0; d < report.datasets.size(); ++d) {
    const std::vector<Crop>& crops = report.datasets[d].crops;
    for (std::size_t c = 0; c < crops.size(); ++c) {
      const auto add = [&](const std::string& what, const Image& image) {
        files.push_back({cropName(d, c, what), encodeDrawnPng(image)});
      };
      add("view", crops[c].overview);
      add("photograph", crops[c].photograph);
      for (std::size_t m = 0; m < crops[c].pictures.size(); ++m) {
        add("model-" + std::to_string(m + 1), crops[c].pictures[m]);
        add("flip-" + std::to_string(m + 1), flipPicture(crops[c].errors[m]));
      }
    }
  }
}

}  // namespace

std::string displayText(const std::string& text) {
  return nlohmann::json::parse(dumpJson(nlohmann::ordered_json(printable(text)))).get<std::string>();
}

std::vector<ReportRow> rowsOf(const EvalComparison& report) {
  std::vector<ReportRow> rows;
  for (const ReportedDataset& dataset : report.datasets) {
    for (const ReportedModel& model : dataset.models) {
      rows.push_back({dataset, model, "full", meanView(model.full)});
      if (!model.base.empty()) rows.push_back({dataset, model, "base only", meanView(model.base)});
      if (!model.texture.empty()) rows.push_back({dataset, model, "texture only", meanView(model.texture)});
    }
  }
  return rows;
}

std::vector<ReportFile> reportFiles(const EvalComparison& report) {
  std::vector<ReportFile> files;
  std::vector<PageChart> charts;
  for (std::size_t d = 0; d < report.datasets.size(); ++d) {
    const ReportedDataset& dataset = report.datasets[d];
    const auto add = [&](const std::string& name, const std::string& title, const std::string& note,
                         const std::string& svg) {
      files.push_back({name + "-" + std::to_string(d + 1) + ".svg", bytesOf(standaloneSvg(svg))});
      charts.push_back({title, note, svg, d});
    };
    add("psnr", "PSNR of every view", viewsNote(dataset), svgOf(psnrCurves(dataset)));
    if (const std::optional<Histogram> differences = psnrDifferences(dataset)) {
      add("difference", "PSNR differences", "right of the line: better than " + dataset.models.front().label,
          svgOf(*differences));
    }
    add("opacity", "Opacity", "after the sigmoid", svgOf(opacities(dataset)));
    add("scale", "Scale", "sigma along each of the three axes", svgOf(scales(dataset)));
    add("rank", "Effective rank", "1 needle, 2 disc, 3 ball", svgOf(ranks(dataset)));
    add("texels", "Texels of a Gaussian", "0: no texture", svgOf(texelCounts(dataset)));
  }
  addCrops(report, files);
  files.push_back({"results.csv", bytesOf(formatCsv(report))});
  files.push_back({"views.csv", bytesOf(formatViewsCsv(report))});
  files.push_back({"table.tex", bytesOf(formatLatex(report))});
  files.push_back({"index.html", bytesOf(formatPage(report, charts))});
  return files;
}

}  // namespace tg
