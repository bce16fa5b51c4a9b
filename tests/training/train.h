// SPDX-License-Identifier: Apache-2.0
// A whole training at one call.
#pragma once
#include <atomic>
#include <functional>
#include <optional>
#include <utility>

#include "training/run/trainer.h"

namespace tg {

struct TrainHooks {
  std::function<void(const Trainer&)> after_step;
  const std::atomic<bool>* stop = nullptr;  // set: end after the current step
};

// Steps a trainer to its end.
inline TrainResult train(const Dataset& dataset, const TrainSettings& settings, DifferentiableRenderer& renderer,
                         const TrainHooks& hooks = {}, std::optional<GaussianModel> start = std::nullopt) {
  Trainer trainer(dataset, settings, renderer, std::move(start));
  while (!trainer.finished() && !(hooks.stop && hooks.stop->load(std::memory_order_relaxed))) {
    if (trainer.step(hooks.stop) && hooks.after_step) hooks.after_step(trainer);
  }
  return trainer.result();
}

}  // namespace tg
