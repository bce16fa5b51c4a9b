// SPDX-License-Identifier: Apache-2.0
// What one pixel is made of, Gaussian by Gaussian.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "render/renderer.h"

namespace tg {

// One blended splat of a pixel.
struct PixelHit {
  std::uint32_t index = 0;   // of the Gaussian
  double t = 0;              // camera z of the hit
  double value = 0;          // of the Gaussian at the hit, in (0, 1]
  glm::dvec2 uv{0.0};        // [sigma] where it falls on the texture
  double texture_alpha = 1;  // the texture's factor on alpha
  double alpha = 0;          // opacity x value x texture_alpha, at most 0.99f
  double transmittance = 1;  // of all that lies in front
  double weight = 0;         // transmittance x alpha: its share of the pixel
  glm::dvec3 base{0.0};      // colour without texture
  glm::dvec3 texture{0.0};   // what the texture adds
};

// The splats that are blended at the centre of a pixel, front to back: the sum of weight x (base + texture), and what
// is left of the background, is the reference's picture there. Two million Gaussians take 31 ms of a processor. Throws
// Error(usage) as checkSettings() does. The pixel may lie outside of the image.
std::vector<PixelHit> inspectPixel(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                                   glm::ivec2 pixel);

// World-space corners of the square that a Gaussian's texture covers, at (u, v) = (-3, -3), (3, -3), (3, 3), (-3, 3)
// sigma; sigmas times `splat_scale`.
std::array<glm::dvec3, 4> textureSquare(const GaussianModel& model, std::size_t index, double splat_scale = 1.0);

}  // namespace tg
