// SPDX-License-Identifier: Apache-2.0
// The host's part of a step around forward and backward: what is drawn of a model, and what a gradient does to it.
#pragma once
#include <cstddef>
#include <span>
#include <utility>

#include "core/model/model.h"
#include "training/step/densify.h"
#include "training/step/engine.h"
#include "training/step/filter_3d.h"
#include "training/step/gradient.h"
#include "training/step/optimizer.h"

namespace tg {

// While it lives, the model's scales and opacities are the effective ones, where it is filtered.
class DrawnModel {
 public:
  DrawnModel(GaussianModel& model, EffectiveParameters& effective, std::span<const float> min_sigma)
      : model_(model), effective_(effective), filtered_(!min_sigma.empty()) {
    if (filtered_) applyFilter(model, min_sigma, effective);
    exchange();
  }
  ~DrawnModel() { exchange(); }
  DrawnModel& operator=(DrawnModel&&) = delete;

 private:
  void exchange() {
    if (!filtered_) return;
    std::swap(model_.log_scale, effective_.log_scale);
    std::swap(model_.opacity_logit, effective_.opacity_logit);
  }
  GaussianModel& model_;
  EffectiveParameters& effective_;
  bool filtered_;
};

// What of a model's Gaussians are there: some run of them, from `first` on, of `count`.
struct ModelPart {
  std::size_t first = 0;
  std::size_t count = 0;
};
// Moves the parameters by a gradient of what was drawn, which it changes, and adds to the statistics where `input` asks
// for that. Of `input` camera, view and photograph do not count.
void updateParameters(TrainingState& training, std::span<const float> min_sigma, DensityStatistics& statistics,
                      const StepInput& input, const ModelPart& part, ModelGradient& gradient);

}  // namespace tg
