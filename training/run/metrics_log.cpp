// SPDX-License-Identifier: Apache-2.0
// Lines at their times.
#include "training/run/metrics_log.h"

#include <optional>

#include "training/run/report.h"

namespace tg {
namespace {

void addScore(RunMetrics& line, const Score& score) {
  line.test_psnr = score.psnr;
  line.test_ssim = score.ssim;
  line.test_views = score.views;
}

}  // namespace

void MetricsLog::resume(Stage stage, bool finished) {
  stage_ = stage;
  finished_ = finished;
}

void MetricsLog::afterStep(const Trainer& trainer, double seconds, const Sink& tell) {
  tellStages(trainer, seconds, tell);
  TrainProgress progress = trainer.progress();
  const int iteration = progress.iteration;
  const bool last = iteration == progress.iterations;
  const bool evaluate = eval_every_ > 0 && iteration % eval_every_ == 0 && !last;
  const bool due = metrics_every_ > 0 && iteration % metrics_every_ == 0;
  if (!due && !evaluate && !last) return;
  trainer.settle();
  RunMetrics line = metricsOf(trainer.progress(), seconds);
  if (evaluate) {
    if (const std::optional<Score> score = trainer.testScore(stop)) addScore(line, *score);
  }
  tell(line);
}

void MetricsLog::finish(const Trainer& trainer, double seconds, const Sink& tell) {
  if (!finished_) tellStages(trainer, seconds, tell);
  finished_ = trainer.finished();
}

// Test scores of the stages that have ended since the last step.
void MetricsLog::tellStages(const Trainer& trainer, double seconds, const Sink& tell) {
  for (const Stage stage : valuesOf<Stage>()) {
    const StageReport* report = reportOf(trainer.report(), stage);
    const bool ended = stage < trainer.stage() || (stage == trainer.stage() && trainer.finished());
    if (stage < stage_ || !ended || !report || !report->test) continue;
    RunMetrics line;
    line.stage = name(stage);
    line.iteration = line.iterations = report->iterations;
    if (report->iterations > 0) {
      line.loss = report->loss;
      line.train_psnr = report->train_psnr;
      if (report->seconds > 0) line.per_second = report->iterations / report->seconds;
    }
    line.gaussians = report->gaussians;
    line.seconds = seconds;
    const bool more = !trainer.finished();
    if (more) line.seconds_left = trainer.progress().seconds_left;
    addScore(line, *report->test);
    tell(line);
  }
  stage_ = trainer.stage();
}

}  // namespace tg
