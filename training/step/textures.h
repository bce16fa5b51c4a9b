// SPDX-License-Identifier: Apache-2.0
// The step from plain to textured Gaussians, between the two training stages.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/model/atlas.h"
#include "training/settings/settings.h"
#include "training/step/optimizer.h"

namespace tg {

// count equal squares. With a budget: the largest side that stays inside it, at least 1.
std::vector<TextureRect> uniformRects(std::size_t count, int size, std::size_t texel_budget);

// Texels as wide as a fixed number of pixels in the training view that sees the Gaussian largest, sides from 1 to 64:
// w = 6 sigma_u / pixel_sizes / pitch, the pitch so that all rectangles together come nearest to the budget from below
// (or reach 1 x 1 everywhere). pixel_sizes: [N] pixelSizes() of filter_3d.h.
std::vector<TextureRect> footprintRects(const GaussianModel& model, std::span<const float> pixel_sizes,
                                        std::size_t texel_budget);

// Gives Gaussian i the rectangle rects[i] (offsets are made here) and restarts all moments, as stage 2 is its own
// optimisation. neutral: colour 0 and alpha 1, the picture stays the same to the last bit. paper: colour 25/255, taken
// off the constant SH colour, so that only the rim beyond 3 sigma and clamped base colours change.
void addTextures(TrainingState& state, std::vector<TextureRect> rects, TextureMode mode, TextureInit init);

// The gradient of textures that Gaussians share: groups: [N] textureGroups(). The first Gaussian of each group gets the
// sum of all of them, in the Gaussians' order; the others' is not to be used.
void sumOverGroups(const TextureAtlas& atlas, std::span<const std::uint32_t> groups, std::vector<glm::vec4>& gradient);

}  // namespace tg
