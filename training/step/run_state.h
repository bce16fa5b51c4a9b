// SPDX-License-Identifier: Apache-2.0
// Everything that decides how a training run goes on: what a checkpoint holds.
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "core/system/names.h"
#include "training/step/densify.h"
#include "training/step/optimizer.h"
#include "core/system/random.h"

namespace tg {

// count: a stage 1 without limit, only to learn how many Gaussians it makes. untextured: stage 2 without textures.
// quantized: what stands, parameter by parameter as a file will hold it, while those that are left make up for it.
enum class Stage { count, plain, textured, untextured, quantized };
constexpr auto namesOf(Stage) { return enumNames("count", "plain", "textured", "untextured", "quantized"); }

// Every view once in random order, then again in another.
struct ViewOrder {
  std::vector<std::uint32_t> views;
  Random random{0};
  std::uint32_t position = 0;  // of the next one; 0: a new order first

  std::size_t next();
  // The view after next(), when it is already known.
  std::optional<std::size_t> following() const;
};

// Mean of a series that forgets; unbiased from the first value on.
struct RunningMean {
  double sum = 0;
  double weight = 0;

  void add(double value);
  double value() const { return weight > 0 ? sum / weight : 0; }
};

// Means over the views, of what training reports.
struct Score {
  double psnr = 0;
  double ssim = 0;
  std::size_t views = 0;
};

struct StageReport {
  int iterations = 0;  // done
  double seconds = 0;  // without evaluation
  double loss = 0;     // running means at the end
  double train_psnr = 0;
  std::size_t gaussians = 0;
  std::optional<Score> test;
};

struct TrainReport {
  double extent = 0;
  std::size_t initial_gaussians = 0;
  std::optional<StageReport> count;
  StageReport plain;
  std::optional<StageReport> textured;
  std::optional<StageReport> untextured;
  std::optional<StageReport> quantized;
  bool interrupted = false;
};

// Null where there is none.
const StageReport* reportOf(const TrainReport& report, Stage stage);
void setReport(TrainReport& report, Stage stage, const StageReport& of);

struct RunState {
  Stage stage = Stage::plain;
  int iteration = 0;  // done in the stage
  bool finished = false;
  std::size_t default_gaussians = 0;  // settings.default_gaussians, or what stage count found

  TrainingState training;
  std::vector<float> min_sigma;  // [N] world units, of the 3D filter; empty: off (filter_3d.h)
  DensityStatistics statistics;
  Random densify_random{0};
  ViewOrder order;
  RunningMean loss;
  RunningMean squared_error;
  double seconds = 0;  // in the stage
  // [N] StepInput's, once the stage has looked for them; empty where no textures are shared. Kept, since textures that
  // are equal by chance when a run goes on are not shared.
  std::optional<std::vector<std::uint32_t>> texture_groups;

  float file_steps = 0;  // of the file that stage quantized is for; 0: not chosen yet

  GaussianModel untextured_start;  // stage-1 model that waits for stage untextured; empty: none
  GaussianModel textured;          // finished model of stage textured, while stage untextured runs
  TrainReport report;
};

}  // namespace tg
