// SPDX-License-Identifier: Apache-2.0
// A run's state to the device and back.
#include "training/cuda/state.h"

#include <algorithm>

#include "core/model/texture_dictionary.h"

namespace tg::cuda {
namespace {

using Rects = std::vector<TextureRect>;

// Numbers of texels, `each` of a texel, of the one layout's rectangles in the other's. Where several come to one place
// the first one's count: a group's first Gaussian is the one whose moments the CPU keeps.
template <typename T>
std::vector<T> moved(const std::vector<T>& numbers, std::size_t each, const Rects& from, const Rects& to) {
  std::size_t texels = 0;
  for (const TextureRect& rect : to) texels = std::max(texels, std::size_t{rect.offset} + rect.texelCount());
  std::vector<T> result(each * texels);
  for (std::size_t i = to.size(); i-- > 0;) {
    std::copy_n(numbers.begin() + static_cast<std::ptrdiff_t>(each * from[i].offset), each * from[i].texelCount(),
                result.begin() + static_cast<std::ptrdiff_t>(each * to[i].offset));
  }
  return result;
}

}  // namespace

void upload(const RunState& from, std::span<const std::uint32_t> texture_groups, DeviceState& to) {
  to = {};  // another stage may need less
  const GaussianModel& model = from.training.model;
  const auto put = [](const Field&, DeviceMoments& device, const Moments& host) {
    device.first.upload(host.first);
    device.second.upload(host.second);
  };
  if (texture_groups.empty()) {
    to.model.upload(model);
    forEachParameter(put, to.moments, from.training.moments);
  } else {
    const TextureAtlas once = heldOnce(model.atlas, texture_groups);
    to.model.upload(model, once);
    forEachField(put, to.moments, from.training.moments);
    const Moments& texels = from.training.moments.texels;
    to.moments.texels.first.upload(moved(texels.first, 4, model.atlas.rects, once.rects));
    to.moments.texels.second.upload(moved(texels.second, 4, model.atlas.rects, once.rects));
    to.owners.upload(firstOfGroups(texture_groups));
    to.shared_rects = once.rects;
  }
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
  if (!from.shared_rects.empty()) {
    TextureAtlas& atlas = to.training.model.atlas;
    atlas.texels = moved(atlas.texels, 1, from.shared_rects, atlas.rects);
    Moments& texels = to.training.moments.texels;
    texels.first = moved(texels.first, 4, from.shared_rects, atlas.rects);
    texels.second = moved(texels.second, 4, from.shared_rects, atlas.rects);
  }
  to.training.step = from.step;
  from.min_sigma.downloadAll(to.min_sigma);
  from.statistics.score_sum.downloadAll(to.statistics.score_sum);
  from.statistics.magnitude_sum.downloadAll(to.statistics.magnitude_sum);
  from.statistics.max_radius.downloadAll(to.statistics.max_radius);
  from.statistics.view_count.downloadAll(to.statistics.view_count);
}

}  // namespace tg::cuda
