// SPDX-License-Identifier: Apache-2.0
// What of a run lies on the device between steps.
#pragma once
#include "training/cuda/frame.h"
#include "training/cuda/step.h"
#include "training/step/run_state.h"

namespace tg::cuda {

struct StateMoments {
  DeviceMoments mean, rotation, log_scale, opacity_logit, sh, texels;
};

struct DeviceState {
  DeviceModel model;
  StateMoments moments;
  DeviceStatistics statistics;
  Buffer<float> min_sigma;  // [N]; empty: no 3D filter
  std::int64_t step = 0;    // TrainingState::step
};

void upload(const RunState& from, DeviceState& to);
// Everything but the rectangles, which do not change on the device. Arrays get the device's sizes.
void download(const DeviceState& from, RunState& to);

// Calls visit(parameter, moments, floats a Gaussian) for all parameters but texels.
template <typename Visit>
void forEachParameter(DeviceState& state, const Visit& visit) {
  visit(state.model.mean, state.moments.mean, 3u);
  visit(state.model.rotation, state.moments.rotation, 4u);
  visit(state.model.log_scale, state.moments.log_scale, 3u);
  visit(state.model.opacity_logit, state.moments.opacity_logit, 1u);
  visit(state.model.sh, state.moments.sh, 3u * static_cast<unsigned>(state.model.sh_count));
}

}  // namespace tg::cuda
