// SPDX-License-Identifier: Apache-2.0
// Several models on several data sets: what a report says, and the files that say it.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "training/figures/crops.h"
#include "training/figures/model_numbers.h"
#include "training/score/evaluate.h"

namespace tg {

// A model on a data set.
struct ReportedModel {
  std::string label;  // UTF-8
  ModelNumbers numbers;
  std::vector<ViewScore> full;           // one a view
  std::vector<ViewScore> base, texture;  // of the base colour alone, of the textures' alone; empty where there are none
};

struct ReportedDataset {
  std::string name, split;  // UTF-8
  std::size_t asked = 0;    // views; more than scores: interrupted
  std::vector<ReportedModel> models;
  std::vector<Crop> crops;
};

struct EvalComparison {
  std::vector<ReportedDataset> datasets;
  double flip_pixels_per_degree = kFlipPixelsPerDegree;
  std::string lpips;  // "vgg, input in [-1,1]"; empty: not measured
};

// A row of the tables: the mean of a model's views, or of one part of its pictures.
struct ReportRow {
  const ReportedDataset& dataset;
  const ReportedModel& model;
  const char* part;  // "full", "base only", "texture only"
  ViewScore mean;
};
std::vector<ReportRow> rowsOf(const EvalComparison& report);

struct ReportFile {
  std::string name;  // in the report's folder
  std::vector<std::uint8_t> bytes;
};
// index.html, results.csv, views.csv, table.tex, *.svg, crops/*.png. The same report gives the same bytes.
std::vector<ReportFile> reportFiles(const EvalComparison& report);

// ---- tables.cpp
std::string formatCsv(const EvalComparison& report);       // a line a row
std::string formatViewsCsv(const EvalComparison& report);  // a line a view and part
std::string formatLatex(const EvalComparison& report);     // booktabs
std::string csvText(const std::string& text);              // in quotes where it must be
std::string latexText(const std::string& text);
// "31.42", or "inf" for equal pictures.
std::string decibels(double value, int decimals);
// 1234567 as "1,234,567".
std::string grouped(std::uintmax_t number, const char* separator);

// ---- page.cpp
std::string htmlText(const std::string& text);
struct PageChart {
  std::string title, note, svg;
  std::size_t dataset;
};
std::string formatPage(const EvalComparison& report, const std::vector<PageChart>& charts);
std::string cropName(std::size_t dataset, std::size_t crop, const std::string& what);  // "crops/1-2-WHAT.png"

// Bytes that are no UTF-8 become U+FFFD, control characters question marks.
std::string displayText(const std::string& text);

// ---- folder.cpp
// Before any work. Throws Error(cannotWrite) where there is something at `folder` that is not an empty folder, or, with
// `overwrite`, no report.
void requireReportFolder(const std::filesystem::path& folder, bool overwrite);
// Writes all files beside `folder`, then gives them that name: all of them or none. Throws as requireReportFolder()
// does, and Error(cannotWrite).
void writeReportFolder(const std::filesystem::path& folder, bool overwrite, const std::vector<ReportFile>& files);

}  // namespace tg
