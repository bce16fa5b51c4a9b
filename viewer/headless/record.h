// SPDX-License-Identifier: Apache-2.0
// --output: a path or a turntable to pictures or a video, without a window.
#pragma once
#include "viewer/view/options.h"

namespace tg {

// Says how far it is on stderr and prints one line about the result to stdout. Throws Error of every kind; a run that
// fails leaves no video.
void recordToFile(const ViewOptions& options);

}  // namespace tg
