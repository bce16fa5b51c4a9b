// SPDX-License-Identifier: Apache-2.0
// Whoever looks at a run while it trains: windows by its folder, browsers by --serve.
#pragma once
#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <utility>

#include "converter/serve/page_server.h"
#include "training/run/live_folder.h"
#include "training/run/metrics_log.h"
#include "training/run/run_folder.h"
#include "training/run/trainer.h"

namespace tg {

// A step costs a look at the clock while nobody watches. What is shown is a copy of the model: training's bytes do not
// depend on it.
class Watchers {
 public:
  // Both may be null. All outlive this. A run that is ordered to stop sets `stop`. `log`: where there is no folder.
  Watchers(const Dataset& dataset, RunFolder* run, PageServer* page, std::atomic<bool>& stop, MetricsLog log);
  ~Watchers();
  Watchers& operator=(Watchers&&) = delete;

  // Before each step: waits while the run is paused.
  void beforeStep(const Trainer& trainer);
  void afterStep(const Trainer& trainer);
  // Views have been scored, `done` of `views`.
  void scoring(const Trainer& trainer, std::size_t done, std::size_t views);
  // The last state; waits a moment for whoever is to see it, or until `stop` is set.
  void finish(const Trainer& trainer);

 private:
  using Clock = std::chrono::steady_clock;
  using Moment = std::pair<Stage, int>;  // and iteration

  void look(const Trainer& trainer);
  void obey(const RunOrder& order);
  void tell(const RunMetrics& line);
  void show(const Trainer& trainer, RunPhase phase, bool at_once);
  void showHeldOut(const Trainer& trainer);
  double seconds() const;

  const Dataset& dataset_;
  RunFolder* const run_;
  PageServer* const page_;
  std::atomic<bool>& stop_;
  const Clock::time_point start_ = Clock::now();
  MetricsLog log_;
  std::unique_ptr<LiveFolder> live_;
  std::optional<double> test_psnr_, test_ssim_;  // newest
  std::optional<std::size_t> test_views_;
  Moment to_window_{Stage::count, -1}, to_page_{Stage::count, -1}, to_pictures_{Stage::count, -1};  // shown last
  bool paused_ = false;
  int steps_left_ = 0;  // before it pauses again
  Clock::time_point next_look_{}, next_held_out_{};
};

}  // namespace tg
