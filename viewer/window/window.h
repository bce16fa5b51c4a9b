// SPDX-License-Identifier: Apache-2.0
// The interactive viewer.
#pragma once
#include "viewer/view/options.h"

namespace tg {

// Opens the model and a window, and returns when it is closed. Throws Error of every kind; without a display
// Error(device) that names --render.
void runWindow(const ViewOptions& options);

}  // namespace tg
