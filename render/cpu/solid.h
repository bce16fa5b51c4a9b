// SPDX-License-Identifier: Apache-2.0
// The outputs that do not blend (docs/math.md 5.2): Gaussians as solid ellipsoids, and as dots.
#pragma once
#include "render/cpu/tiles.h"

namespace tg::cpu {

// screen and lists: of a view with fixed_radius 1 and the max-response model, so that boxes hold the ellipsoids.
void drawEllipsoids(const View& view, const GaussianModel& model, const ScreenSplats& screen, const TileLists& lists,
                    std::vector<glm::vec3>& pixels);
// order: positions in screen.splats, nearest first. Any view's splats.
void drawCenters(const View& view, const ScreenSplats& screen, const std::vector<std::uint32_t>& order,
                 std::vector<glm::vec3>& pixels);

}  // namespace tg::cpu
