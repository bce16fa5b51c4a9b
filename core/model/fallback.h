// SPDX-License-Identifier: Apache-2.0
// The best untextured stand-in for a textured model: what viewers show that know no textures.
#pragma once
#include "core/model/model.h"

namespace tg {

// The same Gaussians without textures: each colour and opacity moved by its texture's mean over the splat, weighted by
// the Gaussian (docs/gltf.md, "Fallback"). Untextured Gaussians are unchanged.
GaussianModel bakeFallback(const GaussianModel& model);

// The inverse, in place, where `model` has the textures beside colours and opacities that stand in for them. Opacities
// above 1 become 1.
void removeFallback(GaussianModel& model);

}  // namespace tg
