// SPDX-License-Identifier: Apache-2.0
// Numbers as colours.
#pragma once
#include <glm/glm.hpp>

namespace tg {

// turbo: Mikhailov, "Turbo, An Improved Rainbow Colormap for Visualization", Google 2019 (Apache-2.0). viridis, magma:
// van der Walt & Smith, matplotlib 1.5, 2015 (CC0). Their published tables of 256 colours, linear between two.
// heat: black, red, yellow, white.
enum class ColorMap { grey, heat, turbo, viridis, magma };

// x is clamped to [0, 1].
glm::vec3 colorOf(ColorMap map, float x);

}  // namespace tg
