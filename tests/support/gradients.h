// SPDX-License-Identifier: Apache-2.0
// A DifferentiableRenderer's gradients against the float64 reference.
#pragma once
#include <memory>
#include <vector>

#include "render/reference/reference.h"
#include "training/step/gradient.h"

namespace tg::test {

// A loss that weighs every pixel and channel by another number: L = sum v_color . picture.
std::vector<glm::dvec3> randomWeights(const Camera& camera, unsigned seed);

ModelGradient gradientOf(DifferentiableRenderer& renderer, const GaussianModel& model, const Camera& camera,
                         const RenderSettings& settings, const std::vector<glm::dvec3>& weights,
                         const GradientOptions& options = {});

// |a - b| / |b| over all components of each array.
template <typename>
using ErrorOf = double;
struct BlockErrors : ModelFields<ErrorOf> {
  double screen, screen_abs;
};
BlockErrors compare(const ModelGradient& gradient, const ReferenceGradient& reference);

// CHECKs that every block's error is below `allowed`.
void checkAgainstReference(const ModelGradient& gradient, const GaussianModel& model, const Camera& camera,
                           const RenderSettings& settings, const std::vector<glm::dvec3>& weights,
                           const ReferenceOptions& options = {}, double allowed = 1e-4);

// The same with random weights, of a renderer that `make` makes anew each time: on every kind of scene in both
// intersection models, and in every texture mode.
using MakeRenderer = std::unique_ptr<DifferentiableRenderer> (*)();
void checkEveryScene(MakeRenderer make);
void checkEveryTextureMode(MakeRenderer make);
// Of models that draw nothing beyond their textures.
void checkClippedTextures(MakeRenderer make);
// Where rays lie in the plane of the plane model's Gaussians, which the formula divides by 0 for.
void checkRaysInPlane(MakeRenderer make);

bool sameBytes(const ModelGradient& a, const ModelGradient& b);

}  // namespace tg::test
