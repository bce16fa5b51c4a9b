// SPDX-License-Identifier: Apache-2.0
// Between the makers of contexts and what describes them.
#pragma once
#include <string>

#include "render/gl/gl_device.h"

namespace tg {

// Why the current context cannot run the passes, or empty.
std::string whatIsMissing();
// Fills in all of `device` from the current context, and listens to its messages when options.debug.
void describeContext(GlDevice& device, const GlOptions& options);

}  // namespace tg
