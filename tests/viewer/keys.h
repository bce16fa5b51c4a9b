// SPDX-License-Identifier: Apache-2.0
// A key of the keyboard, as the window hands it on.
#pragma once
#include "support/catch.h"
#include "viewer/view/actions.h"
#include "viewer/view/state.h"

namespace tg::test {

inline void press(ViewerState& state, int key, bool shift = false) {
  const auto action = actionOf(key, shift);
  REQUIRE(action);
  apply(state, *action);
}

}  // namespace tg::test
