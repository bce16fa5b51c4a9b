// SPDX-License-Identifier: Apache-2.0
// The order of views and the running mean.
#include "training/step/run_state.h"

#include <utility>

#include "core/system/assert.h"

namespace tg {

std::size_t ViewOrder::next() {
  TG_ASSERT(!views.empty(), "there is a view to go to");
  TG_ASSERT(position <= views.size(), "the position is among the views");
  if (position == 0) random.shuffle(views);
  const std::size_t view = views[position];
  position = static_cast<std::uint32_t>((position + 1) % views.size());
  return view;
}

std::optional<std::size_t> ViewOrder::following() const {
  return position == 0 ? std::nullopt : std::optional<std::size_t>(views[position]);
}

void RunningMean::add(double value) {
  constexpr double kPast = 0.98;  // about 50 views
  sum = kPast * sum + value;
  weight = kPast * weight + 1;
}

}  // namespace tg
