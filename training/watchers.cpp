// SPDX-License-Identifier: Apache-2.0
// What is shown when, and orders.
#include "training/watchers.h"

#include <algorithm>
#include <cstdio>
#include <thread>
#include <utility>

#include "core/bundle/training_json.h"
#include "core/run/curves.h"
#include "core/system/error.h"
#include "training/run/report.h"
#include "training/run/trained_bundle.h"

namespace tg {
namespace {

constexpr std::chrono::milliseconds kLookPause(200), kPausedPause(50), kHeldOutPause(5000), kLastLook(10000);

static_assert(std::ranges::equal(kTrainingStages, namesOf(Stage{}), {}, &TrainingStage::name),
              "training.json names the trainer's stages");

// What a window knows of a run by its file.
std::string progressJson(const TrainProgress& progress) {
  const auto& [stage, iterations] = kTrainingStages[static_cast<std::size_t>(progress.stage)];
  return "{\"program\": \"tgtrain\", \"interrupted\": true, \"settings\": {\"" + std::string(iterations) +
         "\": " + std::to_string(progress.iterations) + "}, \"stages\": {\"" + std::string(stage) +
         "\": {\"iterations\": " + std::to_string(progress.iteration) +
         ", \"train_psnr\": " + std::to_string(progress.psnr) + "}}}\n";
}

}  // namespace

Watchers::Watchers(const Dataset& dataset, RunFolder* run, PageServer* page, std::atomic<bool>& stop, MetricsLog log)
    : dataset_(dataset), run_(run), page_(page), stop_(stop), log_(log) {
  log_.stop = &stop;
  if (!run_) return;
  live_ = std::make_unique<LiveFolder>(run_->folder(), run_->metricsDescriptor());
  MetricsFile before(run_->folder() / kMetricsName);
  before.update();
  for (const RunMetrics& line : before.lines()) tell(line);
  run_->onMetrics([this](const RunMetrics& line) { tell(line); });
}

Watchers::~Watchers() {
  if (run_) run_->onMetrics({});
}

double Watchers::seconds() const {
  return run_ ? run_->seconds() : std::chrono::duration<double>(Clock::now() - start_).count();
}

void Watchers::tell(const RunMetrics& line) {
  if (line.test_psnr) {
    test_psnr_ = line.test_psnr;
    test_ssim_ = line.test_ssim;
    test_views_ = line.test_views;
  }
  if (page_) page_->add(line);
}

void Watchers::obey(const RunOrder& order) {
  const bool was = paused_;
  paused_ = order.command == RunCommand::pause || order.command == RunCommand::step;
  steps_left_ = order.command == RunCommand::step ? order.steps : 0;
  if (order.command == RunCommand::stop) stop_ = true;
  if (paused_ && page_) page_->notePause();
  if (paused_ && !was && live_) {
    std::fprintf(stderr, "tgtrain: paused by %s (go in it goes on)\n",
                 printable((run_->folder() / kControlName).string()).c_str());
  }
}

void Watchers::look(const Trainer& trainer) {
  next_look_ = Clock::now() + kLookPause;
  if (live_) {
    live_->look();
    if (const std::optional<RunOrder> order = live_->takeOrder()) obey(*order);
  }
  show(trainer, paused_ && steps_left_ == 0 ? RunPhase::paused : RunPhase::training, false);
}

void Watchers::show(const Trainer& trainer, RunPhase phase, bool at_once) {
  const bool window = live_ && live_->watched(), page = page_ && page_->watched();
  if (!window && !page && !at_once) return;
  if (phase != RunPhase::scoring) trainer.settle();
  RunStatus status{phase, dataset_.name, metricsOf(trainer.progress(), seconds())};
  status.now.test_psnr = test_psnr_;
  status.now.test_ssim = test_ssim_;
  status.now.test_views = test_views_;
  if (phase == RunPhase::finished) status.now.seconds_left = 0;
  if (page_) page_->show(status);
  if (window) live_->show(status);
  if (phase == RunPhase::scoring) return;
  const Moment now(trainer.stage(), status.now.iteration);
  const bool to_window = window && to_window_ != now && live_->wantsModel();
  const bool to_page = page_ && to_page_ != now && (page_->wantsModel() || at_once);
  if (to_window || to_page) {
    const Clock::time_point start = Clock::now();
    auto bundle = std::make_shared<Bundle>();
    bundle->model = trainer.model();
    bundle->cameras = dataset_.views;
    bundle->background = dataset_.background;
    bundle->training_json = progressJson(trainer.progress());
    const double cost = std::chrono::duration<double>(Clock::now() - start).count();
    if (to_window) {
      live_->show(bundle, cost);
      to_window_ = now;
    }
    if (to_page) {
      page_->show(bundle);
      to_page_ = now;
    }
  }
  if (page && to_pictures_ != now && (at_once || Clock::now() >= next_held_out_)) {
    showHeldOut(trainer);
    to_pictures_ = now;
  }
}

void Watchers::showHeldOut(const Trainer& trainer) {
  if (dataset_.indices(true).empty()) return;
  const std::size_t view = previewView(dataset_);
  const Camera& camera = dataset_.views[view];
  page_->showHeldOut(camera.name, dataset_.pixels(view)->image(), trainer.picture(camera));
  next_held_out_ = Clock::now() + kHeldOutPause;
}

void Watchers::beforeStep(const Trainer& trainer) {
  if (!paused_) return;
  if (steps_left_ > 0) {
    --steps_left_;
    return;
  }
  while (paused_ && steps_left_ == 0 && !stop_) {
    look(trainer);
    std::this_thread::sleep_for(kPausedPause);
  }
  if (steps_left_ > 0) --steps_left_;
}

void Watchers::afterStep(const Trainer& trainer) {
  if (page_ && !run_) log_.afterStep(trainer, seconds(), [this](const RunMetrics& line) { tell(line); });
  if (Clock::now() >= next_look_) look(trainer);
}

void Watchers::scoring(const Trainer& trainer, std::size_t done, std::size_t views) {
  if (done == views || Clock::now() < next_look_) return;
  next_look_ = Clock::now() + kLookPause;
  show(trainer, RunPhase::scoring, false);
}

void Watchers::finish(const Trainer& trainer) {
  if (page_ && !run_) log_.finish(trainer, seconds(), [this](const RunMetrics& line) { tell(line); });
  if (!page_ || !page_->watched()) return;
  show(trainer, trainer.finished() ? RunPhase::finished : RunPhase::interrupted, true);
  page_->linger(kLastLook, stop_ ? nullptr : &stop_);  // what has stopped it is no second signal
}

}  // namespace tg
