// SPDX-License-Identifier: Apache-2.0
// What of a run lies on the device between steps.
#pragma once
#include "training/cuda/frame.h"
#include "training/cuda/step.h"
#include "training/step/run_state.h"

namespace tg::cuda {

template <typename>
using DeviceMomentsOf = DeviceMoments;
using StateMoments = ModelFields<DeviceMomentsOf>;

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

}  // namespace tg::cuda
