// SPDX-License-Identifier: Apache-2.0
// The two-stage recipe: plain Gaussians with densification, then textures on a fixed set of Gaussians.
#pragma once
#include <atomic>
#include <functional>
#include <optional>
#include <vector>

#include "core/model/model.h"
#include "training/data/dataset.h"
#include "training/run/time_left.h"
#include "training/settings/schedule.h"
#include "training/settings/settings.h"
#include "training/step/density_math.h"
#include "training/step/engine.h"
#include "training/step/gradient.h"
#include "training/step/run_state.h"

namespace tg {

struct TrainResult {
  GaussianModel model;
  std::optional<GaussianModel> untextured;
  TrainReport report;
};

// Of a stage, as settings have it.
int iterationsOf(const TrainSettings& settings, Stage stage);

// What can be said of it before there are photographs. `shares`: as TrainingEngine::sharesTextures(). Throws what
// Trainer's constructor throws of settings and a start model, which may be null.
void checkTrainable(const TrainSettings& settings, const GaussianModel* start, bool shares);

struct TrainProgress {
  Stage stage = Stage::plain;
  int iteration = 0;
  int iterations = 0;  // of the stage
  double loss = 0;     // running means
  double psnr = 0;
  std::size_t gaussians = 0;
  double per_second = 0;
  double seconds_left = 0;  // of the whole run (time_left.h)
};

// A run, one iteration at a time. Its state after a step determines everything that follows: a Trainer made from that
// state goes on to the same bytes, with any number of threads.
class Trainer {
 public:
  // The data set and the renderer must outlive the trainer. `start`: the model to go on from, in stage 1 instead of
  // from the data set's points, or with its textures in stage 2. Throws Error(usage) for settings that checkSettings()
  // refuses, for a textured start where stage 2 is to have a twin, no textures or the paper's first texels, and for one
  // that does not draw the base beyond its textures; Error(badData) when there is nothing to start from.
  Trainer(const Dataset& dataset, const TrainSettings& settings, DifferentiableRenderer& renderer,
          std::optional<GaussianModel> start = std::nullopt);
  // Goes on from a state of a trainer with the same data set and settings.
  Trainer(const Dataset& dataset, const TrainSettings& settings, DifferentiableRenderer& renderer, RunState state);

  bool finished() const { return state_.finished; }
  // Ends the stage when it is complete - its test score, the next stage's start - then does one iteration. False: there
  // was none left to do, or `stop` was set during the test score or while textures were shared, which another call
  // does. Throws Error(badData) when no Gaussian is left, or the loss of a step is not finite, as whatever waits for
  // losses does: where training runs on a device, losses are known some steps later.
  bool step(const std::atomic<bool>* stop = nullptr);

  const RunState& state() const;
  // What costs nothing where the state lies on a device.
  Stage stage() const { return state_.stage; }
  const TrainReport& report() const { return state_.report; }
  const Dataset& dataset() const { return dataset_; }
  const TrainSettings& settings() const { return settings_; }
  // Losses as far as they are known; of all steps after settle(), which waits.
  TrainProgress progress() const;
  void settle() const { takeLosses(true); }
  // The model as a file would hold it: 3D filter baked, SH of the full degree.
  GaussianModel model() const;
  // The picture of model(), drawn where the training runs.
  Image picture(const Camera& camera) const;
  // `told` from now on how many views of how many a test score has done.
  void onScoring(std::function<void(std::size_t done, std::size_t views)> told) { scoring_ = std::move(told); }
  // What stage quantized is for; to be set before it begins, if it is to have iterations: gives back the model, its
  // Gaussians in their order, as a file of `steps` will hold it. Where steps are 0 it chooses them.
  using Stored = std::function<GaussianModel(const GaussianModel& model, float& steps)>;
  void onQuantizing(Stored stored) { stored_ = std::move(stored); }
  // Those that were chosen; 0: none yet.
  float fileSteps() const { return state_.file_steps; }
  // On the held-out views; none without test views, or when `stop` is set meanwhile.
  std::optional<Score> testScore(const std::atomic<bool>* stop = nullptr) const;
  // What stands, finished or not.
  TrainResult result() const;
  // What stage plain ended with, where step() threw before the first step with textures was done, for want of room,
  // say: as if that stage had not begun. None elsewhere. The trainer is of no use afterwards.
  std::optional<TrainResult> takePlain();

 private:
  // first: where stage plain starts; empty: at the data set's points.
  void begin(Stage stage, GaussianModel first);
  bool end(const std::atomic<bool>* stop);
  void iterate();
  void densifyAndSchedule(int iteration);
  void densify(int iteration);
  // A state's model as model() gives it back.
  GaussianModel asDrawn(GaussianModel model) const;
  // Adds the losses that are known, or waits for all.
  void takeLosses(bool wait) const;
  // What the engine did, in state_.
  void pull() const;
  void updateFilter();
  std::vector<double> seenWeights();
  void keepMostSeen(std::size_t count);
  // What is wide for its distance in pieces, as far as the limit leaves room.
  void splitWideOnes();
  void cutTextures();
  // Where it is time for it; false: `stop` was set meanwhile, and nothing has changed.
  bool shareTextures(const std::atomic<bool>* stop);
  void findTextureGroups();
  bool swaps() const;
  bool merges() const;
  void mergePairs();
  void keepToLimit();  // at the end of stage 1
  bool picks() const;
  bool resetsOpacity(int iteration) const;
  bool opacitiesSettled(int iteration) const;
  bool swapsAfter(int iteration) const;
  int iterationsOf(Stage stage) const { return tg::iterationsOf(settings_, stage); }
  // In stage quantized: the parameters whose turn has come are from now on as the file holds them.
  void quantizeNext();
  std::size_t limit() const;     // of the count; 0: none
  std::size_t limitNow() const;  // while more grow than will stay
  // The published 5 % a round, or what reaches the limit halfway through the densification of a short run.
  float mcmcGrowth() const;
  GaussianModel firstGaussians() const;
  int automaticTextureSize(std::size_t gaussians) const;  // [texels] a side, where settings name none
  StageReport stageReport() const;
  void beginTimes();
  double texelsEach() const;  // of a Gaussian, in stage 2 before it is cut
  RunPlan plan() const;

  // What stage textured changes of the plain model that it starts from.
  struct Plain {
    IntersectionModel intersection = IntersectionModel::maxResponse;
    std::vector<float> min_sigma;
    std::vector<glm::vec3> constant_color;  // [N] where the first texels are taken off it; else empty
  };

  const Dataset& dataset_;
  const TrainSettings settings_;
  const Schedule schedule_;
  const DensificationTraits traits_;
  const double extent_;
  const std::size_t seen_views_;  // that say what a Gaussian is worth
  const std::vector<Pinhole> filter_cameras_;
  DifferentiableRenderer& renderer_;
  const std::unique_ptr<TrainingEngine> engine_;
  // Parameters, moments and statistics may be ahead in the engine: pull() before they are looked at or changed.
  mutable RunState state_;
  mutable int known_losses_ = 0;  // of the stage's iterations
  std::optional<Plain> plain_;    // until the first step with textures
  const std::size_t test_views_;
  TimeLeft time_left_;
  std::function<void(std::size_t, std::size_t)> scoring_;
  Stored stored_;
};

struct TrainHooks {
  std::function<void(const Trainer&)> after_step;
  const std::atomic<bool>* stop = nullptr;  // set: end after the current step
};

// Steps a trainer to its end.
TrainResult train(const Dataset& dataset, const TrainSettings& settings, DifferentiableRenderer& renderer,
                  const TrainHooks& hooks = {}, std::optional<GaussianModel> start = std::nullopt);

}  // namespace tg
