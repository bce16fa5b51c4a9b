// SPDX-License-Identifier: Apache-2.0
// The middle of some numbers.
#pragma once
#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/system/assert.h"

namespace tg {

// The upper one of an even number.
template <typename T>
T medianOf(std::vector<T> values) {
  TG_ASSERT(!values.empty(), "a value at least");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace tg
