// SPDX-License-Identifier: Apache-2.0
// One Gaussian, many rotations: which of its local axes is called x, and which way it points, changes no picture.
#pragma once
#include <glm/glm.hpp>
#include <span>

#include "core/model/model.h"

namespace tg {

// Renames local axes so that Gaussian i's rotation is as near as it can be to towards[i] (w, x, y, z as in
// core/model/model.h, of any length > 0), with its scales going along: one of the 24 rotations of a cube onto itself.
// Those with a texture, which hangs on its axes, are left alone, as are rotations that are the nearest already; others
// get length 1.
void renameAxesTowards(GaussianModel& model, std::span<const glm::vec4> towards);
// Towards no rotation at all: a rotation's numbers then vary less, and take fewer bytes.
void renameAxesForCoding(GaussianModel& model);

}  // namespace tg
