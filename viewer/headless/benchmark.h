// SPDX-License-Identifier: Apache-2.0
// --benchmark without a window.
#pragma once
#include "viewer/view/options.h"

namespace tg {

// Renders options.path without a window and prints the JSON. On a device a frame is what the window would draw: nothing
// is read back. Throws Error of every kind.
void benchmarkHeadless(const ViewOptions& options);

}  // namespace tg
