// SPDX-License-Identifier: Apache-2.0
// Moves, turns and scales a model: Gaussians with their SH and textures, and the cameras that look at them.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/model/camera.h"
#include "core/model/model.h"

namespace tg {

// x -> scale * rotation * x + translation: all that leaves a textured Gaussian a textured Gaussian.
struct Similarity {
  double scale = 1.0;           // > 0
  glm::dmat3 rotation{1.0};     // orthonormal, det +1
  glm::dvec3 translation{0.0};  // [world units]
};

// The same rotation and scale, but about a point; the translation comes after it.
Similarity about(Similarity similarity, glm::dvec3 point);

// The parts of a matrix that acts on columns (x, y, z, 1). Throws Error(usage) that names what splats cannot follow: a
// mirror, shear, scales that differ by axis, a perspective, numbers that are not finite.
Similarity similarityFrom(const glm::dmat4& matrix);

// In the model's axes. The picture through the moved cameras is the picture before (but for near planes, which stay
// where they are, and rounding). Which local axes carry a texture does not change, even where scales round to a tie.
void transformModel(GaussianModel& model, const Similarity& similarity);
// The same of some Gaussians: which < size, each once.
void transformGaussians(GaussianModel& model, const Similarity& similarity, std::span<const std::uint32_t> which);
void transformCameras(std::vector<Camera>& cameras, const Similarity& similarity);

}  // namespace tg
