// SPDX-License-Identifier: Apache-2.0
// The two-stage recipe: plain Gaussians with densification, then textures on a fixed set of Gaussians.
#pragma once
#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>

#include "core/model.h"
#include "training/dataset.h"
#include "training/evaluate.h"
#include "training/gradient.h"

namespace tg {

struct TrainSettings {
  int iterations = 7000;          // stage 1
  int texture_iterations = 7000;  // stage 2; none with texture mode none
  TextureMode texture_mode = TextureMode::rgba;
  int texture_size = 4;  // [texels] a side
  IntersectionModel intersection = IntersectionModel::maxResponse;
  int sh_degree = 3;
  std::size_t max_gaussians = 0;  // 0: no limit
  std::size_t init_count = 0;     // points to start from; 0: all, or 100,000 random ones where there are none
  std::uint64_t seed = 1;
  bool compare_untextured = false;  // stage 2 once more without textures, from the same stage-1 model
};

enum class Stage { plain, textured, untextured };
std::string_view name(Stage stage);

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
  StageReport plain;
  std::optional<StageReport> textured;
  std::optional<StageReport> untextured;
  bool interrupted = false;
};

struct TrainResult {
  GaussianModel model;
  std::optional<GaussianModel> untextured;
  TrainReport report;
};

struct TrainProgress {
  Stage stage = Stage::plain;
  int iteration = 0;
  int iterations = 0;  // of the stage
  double loss = 0;     // running means
  double psnr = 0;
  std::size_t gaussians = 0;
  double per_second = 0;
  double seconds_left = 0;  // of the whole run, at the pace of this stage
};

struct TrainHooks {
  std::function<void(const TrainProgress&)> progress;  // after every iteration
  const std::atomic<bool>* stop = nullptr;             // set: end after the current step
};

// Throws Error(usage) for settings out of range, Error(badData) when the loss is no longer finite or no Gaussian is
// left.
TrainResult train(const Dataset& dataset, const TrainSettings& settings, DifferentiableRenderer& renderer,
                  const TrainHooks& hooks = {});

// The picture of a model as an image, by the training renderer.
Image renderPicture(DifferentiableRenderer& renderer, const GaussianModel& model, const Camera& camera,
                    const glm::vec3& background);

}  // namespace tg
