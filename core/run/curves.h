// SPDX-License-Identifier: Apache-2.0
// A run's metrics.jsonl as curves, read while it grows.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/run/metrics.h"

namespace tg {

// More lines than are ever drawn are thinned: every second goes, but those with test scores.
inline constexpr std::size_t kMaxCurveLines = 8000;
void addThinned(std::vector<RunMetrics>& lines, RunMetrics line);

// Where the curves of a run's stages lie beside each other: iterations of all stages before, in the lines' order.
std::vector<double> iterationsOfRun(const std::vector<RunMetrics>& lines);

// What is to be seen, lowest and highest: all dots, and of the lines all but the outermost hundredth either way - what
// is worst at the very beginning says nothing about the rest. None where there is nothing.
std::optional<std::pair<double, double>> rangeOfCurves(std::vector<double> lines, std::span<const double> dots);
// What an axis spans that shows it.
std::pair<double, double> withRoom(std::pair<double, double> range);

// Reads what has come since the last look; a file that was cut or replaced is read anew.
class MetricsFile {
 public:
  explicit MetricsFile(std::filesystem::path path) : path_(std::move(path)) {}

  // True when lines() has changed. A missing file has no lines; lines that are none are passed over. Never throws.
  bool update();
  const std::vector<RunMetrics>& lines() const { return lines_; }

 private:
  void clear();

  const std::filesystem::path path_;
  std::vector<RunMetrics> lines_;
  std::uint64_t device_ = 0, inode_ = 0, read_ = 0;  // [bytes]
  std::string rest_;                                 // of a line that is not whole yet
};

}  // namespace tg
