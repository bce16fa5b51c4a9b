// SPDX-License-Identifier: Apache-2.0
// A key of the keyboard, as the window hands it on.
#pragma once
#include "support/catch.h"
#include "viewer/view/actions.h"
#include "viewer/view/state.h"

namespace tg::test {

inline void press(ViewerState& state, int key, bool shift = false) { REQUIRE(pressKey(state, key, shift)); }

}  // namespace tg::test
