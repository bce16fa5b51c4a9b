// SPDX-License-Identifier: Apache-2.0
// What the two halves of the preloaded library share.
#pragma once

namespace tg::test {

// Counts a call of a kind; whether it is the one that TG_FAULT chose. `name`: of the function, for the report.
bool isChosen(const char* kind, const char* name);

// Puts wrappers before OpenGL's and EGL's functions where the program has them.
void takeGl();

}  // namespace tg::test
