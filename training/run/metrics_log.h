// SPDX-License-Identifier: Apache-2.0
// When a run says how it does: every so many iterations, and with test scores at the end of each stage.
#pragma once
#include <atomic>
#include <functional>

#include "core/run/metrics.h"
#include "training/run/trainer.h"

namespace tg {

class MetricsLog {
 public:
  using Sink = std::function<void(const RunMetrics&)>;

  // [iterations] between two lines, and between two test scores among them; 0: none but those of the stages' ends.
  MetricsLog(int metrics_every, int eval_every) : metrics_every_(metrics_every), eval_every_(eval_every) {}

  // Set: test scores are left out, the run is about to end.
  const std::atomic<bool>* stop = nullptr;

  // Stages before `stage` are told already; that one, too, where the run had finished.
  void resume(Stage stage, bool finished);
  // `seconds` since the run's start.
  void afterStep(const Trainer& trainer, double seconds, const Sink& tell);
  void finish(const Trainer& trainer, double seconds, const Sink& tell);

 private:
  void tellStages(const Trainer& trainer, double seconds, const Sink& tell);

  const int metrics_every_, eval_every_;
  Stage stage_ = Stage::count;
  bool finished_ = false;
};

}  // namespace tg
