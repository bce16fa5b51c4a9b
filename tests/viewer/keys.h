// SPDX-License-Identifier: Apache-2.0
// A key of the keyboard, as the window hands it on.
#pragma once
#include <utility>

#include "support/catch.h"
#include "viewer/view/actions.h"
#include "viewer/view/state.h"

namespace tg::test {

// As after a frame that the window has shown.
inline void frameShown(ViewerState& state) {
  if (std::exchange(state.ui.escape_said, false)) state.ui.escape_seen = state.time;
  state.time += 0.01;
}

// In a frame of its own.
inline void press(ViewerState& state, int key, bool shift = false) {
  REQUIRE(pressKey(state, key, shift));
  frameShown(state);
}

}  // namespace tg::test
