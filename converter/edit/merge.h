// SPDX-License-Identifier: Apache-2.0
// Puts one model beside another.
#pragma once
#include <string>

#include "core/model/model.h"

namespace tg {

// Appends `other`, unchanged but for SH coefficients of 0 and neutral textures where the two differ in SH degree and
// texture mode. Throws Error(badData, name, ...) when the two have different intersections, or textures that end in
// another way, and when the texels exceed kMaxModelTexels. `name`: of `other`, for messages.
void mergeModel(GaussianModel& model, const GaussianModel& other, const std::string& name);

}  // namespace tg
