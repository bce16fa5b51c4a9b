// SPDX-License-Identifier: Apache-2.0
// A hand at the window: tgview under a window manager, with a pointer and a keyboard of the X server.
#pragma once
#include <string>
#include <vector>

#include "viewer/process.h"

namespace tg::test {

// Why no hand can drive a window, "" when one can.
std::string noHand();
// `script` begins after the first picture, saved as ready.png. `hand`: lines of driver.sh.
void playByHand(const Workshop& shop, const std::string& script, const std::string& hand,
                std::vector<std::string> models = {"model.tgz"}, const char* program = TG_TGVIEW);
// The script's part of driver.sh's function of that name.
std::string seen(const std::string& name);

}  // namespace tg::test
