// SPDX-License-Identifier: Apache-2.0
// Which APIs may draw.
#pragma once
#include <vector>

#include "render/devices/devices.h"
#include "viewer/view/options.h"

namespace tg {

// The APIs that --backend and --device leave, the first choice first; none for the CPU. Throws Error(usage) when they
// contradict each other.
std::vector<Api> apisFor(const ViewOptions& options, const DevicePick& pick);

}  // namespace tg
