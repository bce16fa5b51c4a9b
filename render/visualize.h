// SPDX-License-Identifier: Apache-2.0
// Pictures that are looked at side by side.
#pragma once
#include <array>

#include "render/renderer.h"

namespace tg {

// One output of kNumberOutputs of two frames as visualize() shows it, but in the colours of one scale, which spans the
// numbers of both; `scale` receives it.
std::array<Image, 2> visualizeBoth(const Frame& first, const Frame& other, Output output,
                                   const RenderSettings& settings, ValueScale& scale);

}  // namespace tg
