// SPDX-License-Identifier: Apache-2.0
// --render: one image to a file, without a display and without touching the window system.
#pragma once
#include "viewer/view/options.h"

namespace tg {

// Writes the image and prints one line about it to stdout, warnings to stderr. Throws Error of every kind; a failed
// run leaves no file.
void renderToFile(const ViewOptions& options);

}  // namespace tg
