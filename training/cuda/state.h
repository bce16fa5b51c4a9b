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
  // Where Gaussians share textures, the device has each once: the Gaussians by which they are moved, and [N] where the
  // texels of each lie. Else empty.
  Buffer<std::uint32_t> owners;
  std::vector<TextureRect> shared_rects;
};

// texture_groups: StepInput's.
void upload(const RunState& from, std::span<const std::uint32_t> texture_groups, DeviceState& to);
// Everything but the rectangles, which do not change on the device. Arrays get the device's sizes, but texels and their
// moments the host's: all Gaussians of a group get the group's.
void download(const DeviceState& from, RunState& to);

}  // namespace tg::cuda
