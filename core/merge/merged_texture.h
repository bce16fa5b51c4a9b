// SPDX-License-Identifier: Apache-2.0
// The texture of a Gaussian that stands for two.
#pragma once
#include <cstddef>
#include <glm/glm.hpp>
#include <vector>

#include "core/model/model.h"
#include "core/model/texture_fit.h"

namespace tg {

// The one that takes the place: its shape, and its colour of degree 0 without a texture.
struct MergedShape {
  glm::dvec3 mean;
  glm::dvec3 sigma;  // > 0
  glm::dmat3 axes;   // columns
  glm::dvec3 dc;
  double opacity;                     // of textures without alpha
  double part_a = 1.0, part_b = 1.0;  // of both opacities, that count
};

// [texels] The larger of both along each axis, as far as that is no more texels than both have together, or 32 x 32,
// and no side is longer than 256: time and memory grow with the sides.
glm::ivec2 mergedSize(const TextureRect& a, const TextureRect& b);

struct MergedTexture {
  glm::ivec2 size;  // mergedSize of both
  std::vector<glm::vec4> texels;
  double opacity;
};

// What Gaussians a and b, one of them textured at least, show in the plane of the merged one to who looks along its
// normal: each of its texels looks where its point falls in both, and takes their light and opacity together. The grid
// is the nearest to that in the mean square, with the merged Gaussian's square as weight.
MergedTexture mergedTexture(const GaussianModel& model, std::size_t a, std::size_t b, const MergedShape& shape,
                            AxisFits& fits);

}  // namespace tg
