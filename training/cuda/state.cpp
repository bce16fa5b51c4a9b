// SPDX-License-Identifier: Apache-2.0
// A run's state to the device and back.
#include "training/cuda/state.h"

namespace tg::cuda {

void upload(const RunState& from, DeviceState& to) {
  to = {};  // another stage may need less
  to.model.upload(from.training.model);
  forEachParameter(
      [](const Field&, DeviceMoments& device, const Moments& host) {
        device.first.upload(host.first);
        device.second.upload(host.second);
      },
      to.moments, from.training.moments);
  to.step = from.training.step;
  to.min_sigma.upload(from.min_sigma);
  to.statistics.score_sum.upload(from.statistics.score_sum);
  to.statistics.magnitude_sum.upload(from.statistics.magnitude_sum);
  to.statistics.max_radius.upload(from.statistics.max_radius);
  to.statistics.view_count.upload(from.statistics.view_count);
}

void download(const DeviceState& from, RunState& to) {
  from.model.download(to.training.model);
  forEachParameter(
      [](const Field&, const DeviceMoments& device, Moments& host) {
        device.first.downloadAll(host.first);
        device.second.downloadAll(host.second);
      },
      from.moments, to.training.moments);
  to.training.step = from.step;
  from.min_sigma.downloadAll(to.min_sigma);
  from.statistics.score_sum.downloadAll(to.statistics.score_sum);
  from.statistics.magnitude_sum.downloadAll(to.statistics.magnitude_sum);
  from.statistics.max_radius.downloadAll(to.statistics.max_radius);
  from.statistics.view_count.downloadAll(to.statistics.view_count);
}

}  // namespace tg::cuda
