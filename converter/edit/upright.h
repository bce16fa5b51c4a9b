// SPDX-License-Identifier: Apache-2.0
// Which way is up, by the cameras that took a model's photographs.
#pragma once
#include <glm/glm.hpp>
#include <optional>
#include <span>

#include "core/model/camera.h"

namespace tg {

// A unit vector, world space: at right angles to what the cameras have at their right, as far as they look in different
// directions, else the mean of what they have at their top. Nothing without cameras, and where they contradict.
std::optional<glm::dvec3> upOf(std::span<const Camera> cameras);

// The shortest turn of one unit vector into another.
glm::dmat3 turnBetween(glm::dvec3 from, glm::dvec3 to);

}  // namespace tg
