// SPDX-License-Identifier: Apache-2.0
// --inspect: a model's splats under a pixel, as JSON.
#pragma once
#include "viewer/view/options.h"

namespace tg {

// Prints to stdout. Throws Error of every kind.
void inspectHeadless(const ViewOptions& options);

}  // namespace tg
