// SPDX-License-Identifier: Apache-2.0
// --render with --compare or --photos: two pictures of one view to one file, and how far they are apart.
#pragma once
#include "viewer/view/options.h"

namespace tg {

// Writes what the window's comparison shows of the same view and prints one line with the metrics. Throws Error of
// every kind; a failed run leaves no file.
void compareToFile(const ViewOptions& options);

}  // namespace tg
