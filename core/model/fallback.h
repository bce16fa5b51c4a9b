// SPDX-License-Identifier: Apache-2.0
// The best untextured stand-in for a textured model: what viewers show that know no textures.
#pragma once
#include <vector>

#include "core/model/model.h"

namespace tg {

// What stands in for a texture's alpha: opacity alone, which formats want that keep the textured model's scales, or a
// smaller Gaussian as well, where alpha is nearer to the middle than the Gaussian is.
enum class FallbackScale { kept, fitted };

// The same Gaussians without textures: each colour, opacity and, if they are fitted, its scales changed by its
// texture's mean and spread, weighted by the Gaussian (docs/gltf.md, "Fallback"). Untextured Gaussians are unchanged.
// Colours that no float holds end at the largest, so that files of them can be read.
GaussianModel bakeFallback(const GaussianModel& model, FallbackScale scale);

// What that adds to each DC coefficient [N, SH]: its texture's mean colour, 0 where there is none.
std::vector<glm::vec3> meanTextureColors(const GaussianModel& model);

// The inverse, in place, where `model` has the textures beside what stands in for them. Opacities above 1 become 1.
void removeFallback(GaussianModel& model, FallbackScale scale);

}  // namespace tg
