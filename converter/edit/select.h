// SPDX-License-Identifier: Apache-2.0
// Keeps some of a model's Gaussians, with their textures: by place, by value, by number.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <string_view>
#include <vector>

#include "core/model/model.h"

namespace tg {

// Keeps Gaussian i where keep[i] != 0, in their order; texels of the others are dropped. Holds both models until the
// end. keep: [N].
void keepGaussians(GaussianModel& model, std::span<const std::uint8_t> keep);

// [N] of 0 and 1, by means; bounds belong to the inside. low, high, center: the model's axes [world units].
std::vector<std::uint8_t> insideBox(const GaussianModel& model, glm::dvec3 low, glm::dvec3 high);
std::vector<std::uint8_t> insideSphere(const GaussianModel& model, glm::dvec3 center, double radius);

// [N]: one number of every Gaussian: x y z [world units], opacity, min_scale max_scale [world units, sigma], volume
// (product of the scales), rank (effective: 1 a needle, 2 a disc, 3 a ball), distance (of the mean from the median of
// all means [world units]), index, sh_energy (sum of the squares of all coefficients above degree 0), texels, red green
// blue (of the base, without SH above degree 0). `name` is one of these.
std::vector<double> valuesOf(const GaussianModel& model, std::string_view name);

// "opacity > 0.1", "0.01 <= max_scale < 2", "index < 1000": one of these numbers between bounds. Throws Error(usage)
// that says what is wrong and what there is.
std::vector<std::uint8_t> whereValue(const GaussianModel& model, std::string_view expression);

}  // namespace tg
