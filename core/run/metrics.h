// SPDX-License-Identifier: Apache-2.0
// A line of a run's metrics.jsonl (docs/training.md), out and in.
#pragma once
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace tg {

// Where a run stands. What is not known is none.
struct RunMetrics {
  std::string stage;
  int iteration = 0;
  int iterations = 0;                // of the stage
  std::optional<double> loss;        // running means
  std::optional<double> train_psnr;  // [dB]
  std::size_t gaussians = 0;
  std::optional<double> per_second;    // iterations, in the stage so far
  double seconds = 0;                  // wall time of the run, all its sessions together
  std::optional<double> seconds_left;  // of the whole run
  std::optional<double> test_psnr;     // [dB] of the held-out views
  std::optional<double> test_ssim;
  std::optional<std::size_t> test_views;
};

// One JSON object with all members in one order, null for none; and the end of the line.
std::string formatMetrics(const RunMetrics& metrics);
// None for a line that is no such object. Members that are missing, as in files of version 0.2, are none.
std::optional<RunMetrics> parseMetrics(std::string_view line);

// To so many decimals, and to the number whose text has no more.
double rounded(double value, int decimals);

}  // namespace tg
