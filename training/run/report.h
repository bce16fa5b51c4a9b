// SPDX-License-Identifier: Apache-2.0
// What a training run says about itself: the progress line, the summary, training.json.
#pragma once
#include <chrono>
#include <string>

#include "core/run/live.h"
#include "core/run/metrics.h"
#include "training/run/trainer.h"

namespace tg {

// One line to stderr: rewritten in place on a terminal, a new line every few seconds elsewhere.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine();  // ends an open line
  void show(const TrainProgress& progress);
  // "scoring views: 12 of 200, 3 s left", from a second after the first call with this `what` on; gone when it is done.
  void show(const std::string& what, std::size_t done, std::size_t count);
  void finish();

 private:
  bool terminal_;
  bool open_ = false;
  std::string counted_;  // what show() counts
  std::chrono::steady_clock::time_point counted_since_{};
  std::chrono::steady_clock::time_point next_{};
};

std::string formatProgress(const TrainProgress& progress);
// Test scores, counts and times, a few lines.
std::string formatSummary(const TrainReport& report, double total_seconds);

// Where a run stands, `seconds` after its start; without test scores.
RunMetrics metricsOf(const TrainProgress& progress, double seconds);

struct TrainingJsonOptions {
  int downscale = 1;
  int threads = 1;
  std::string device;  // DifferentiableRenderer::deviceName()
  double total_seconds = 0;
  // Times, threads and memory differ between runs that give the same model; without them the bytes are the same too.
  bool measurements = true;
  std::string fingerprint;  // datasetFingerprint(), where it is known already
};
// Of every pixel, mask, camera and point: 16 hexadecimal digits.
std::string datasetFingerprint(const Dataset& dataset);
// Of how opaque the pixels are that are trained on, which that does not see where they are the background's colour: as
// many digits. Reads them all.
std::string transparencyFingerprint(const Dataset& dataset);
// The settings, the data set (name, sizes, fingerprint of the pixels and cameras), metrics per stage. No paths.
std::string formatTrainingJson(const Dataset& dataset, const TrainSettings& settings, const TrainReport& report,
                               const GaussianModel& model, const TrainingJsonOptions& options);

// Most memory this process has held. [bytes]
std::uint64_t peakMemory();

}  // namespace tg
