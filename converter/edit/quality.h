// SPDX-License-Identifier: Apache-2.0
// How much a written file differs from its source, seen through a few cameras.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "core/model/camera.h"
#include "core/model/model.h"

namespace tg {

// At most four views at a small size: evenly spaced ones of the model's own cameras, or a ring around it.
std::vector<Camera> qualityViews(const GaussianModel& model, std::span<const Camera> cameras);

// More and smaller ones, 24 or, of a wide scene, viewsForAll(): between them they see what a decision about every
// Gaussian must know.
std::vector<Camera> contributionViews(const GaussianModel& model, std::span<const Camera> cameras);

// The near plane [world units] for pictures of a model: that of shaders/shared/limits.h, and nearer where the scene is
// so small that it would cut much of what the views have in their pictures.
float nearOf(const GaussianModel& model, std::span<const Camera> views);

constexpr const char* kShowsNothing = "nothing of the model shows in the pictures that it is judged by";
// Whether no picture of the views has anything of the model: what is compared there is alike whatever it is.
bool showsNothing(const GaussianModel& model, std::span<const Camera> views);

// PSNR [dB] of all views' pixels together, clamped to [0, 1]; infinity when equal. Rendered on the CPU, from
// nearOf() of `a` on.
double renderedPsnr(const GaussianModel& a, const GaussianModel& b, std::span<const Camera> views,
                    glm::vec3 background);

// Whether a summary has that figure without being asked for it: rendering holds both models, and what both renderers
// make of them.
bool isMeasuredUnasked(const GaussianModel& model);

// The largest differences between two models of the same Gaussians.
struct Deviation {
  double mean = 0;     // [world units]
  double shape = 0;    // of covariances, relative to the larger one's norm: turned axes and scales alike
  double opacity = 0;  // in [0, 1]
  double color = 0;    // DC as a colour, 1 = white
  double sh = 0;       // of coefficients above degree 0
  double texel = 0;    // colour or alpha
  bool isZero() const { return mean == 0 && shape == 0 && opacity == 0 && color == 0 && sh == 0 && texel == 0; }
};
// Nothing when they do not hold the same number of Gaussians. Terms and degrees that one of them lacks do not count.
std::optional<Deviation> deviationOf(const GaussianModel& a, const GaussianModel& b);

}  // namespace tg
