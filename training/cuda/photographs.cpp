// SPDX-License-Identifier: Apache-2.0
// Two slots in turns: steps are launched ahead, so that one is filled while the kernels of an earlier step read the
// other.
#include "training/cuda/photographs.h"

#include <algorithm>
#include <utility>

#include "core/system/assert.h"

namespace tg::cuda {
namespace {

// The mask where it hides anything.
std::span<const std::uint8_t> maskOf(const ViewPixels& photograph, double& counted) {
  const auto ignored = std::count(photograph.mask.begin(), photograph.mask.end(), 0);
  const std::size_t pixels = photograph.rgb.size() / 3 - static_cast<std::size_t>(ignored);
  counted = static_cast<double>(3 * std::max<std::size_t>(pixels, 1));
  return ignored > 0 ? std::span<const std::uint8_t>(photograph.mask) : std::span<const std::uint8_t>();
}

}  // namespace

DevicePhotographs::OnDevice DevicePhotographs::get(std::size_t view, const Pixels& photograph, bool varies) {
  const auto found = kept_.find(view);
  if (found != kept_.end() && !varies) return found->second.view;
  TG_ASSERT(photograph, "there is a photograph where none is kept");
  double counted = 0;
  const std::span<const std::uint8_t> mask = maskOf(*photograph, counted);
  const std::size_t rgb_bytes = photograph->rgb.size();
  if (!varies && !full_) {
    const DeviceMemory memory = deviceMemory();
    if (memory.free > memory.total / 4 + 2 * (rgb_bytes + mask.size())) {
      Kept kept;
      kept.bytes.resize(rgb_bytes + mask.size());
      copyToDevice(kept.bytes.data(), photograph->rgb.data(), rgb_bytes);
      copyToDevice(kept.bytes.data() + rgb_bytes, mask.data(), mask.size());
      kept.view = {kept.bytes.data(), mask.empty() ? nullptr : kept.bytes.data() + rgb_bytes, counted};
      return kept_.emplace(view, std::move(kept)).first->second.view;
    }
    full_ = true;
  }
  StreamedBuffer& slot = slots_[current_];
  slot.begin(photograph->rgb, mask);
  slot.acquire();
  in_use_ = true;
  return {slot.data(), mask.empty() ? nullptr : slot.data() + rgb_bytes, counted};
}

void DevicePhotographs::release() {
  if (!in_use_) return;
  in_use_ = false;
  slots_[current_].release();
  current_ = 1 - current_;
}

}  // namespace tg::cuda
