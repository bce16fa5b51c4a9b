// SPDX-License-Identifier: Apache-2.0
// The picture that somebody else's viewer makes of a model's base, and its derivative.
#pragma once
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/image/image.h"
#include "core/model/camera.h"
#include "core/model/model.h"
#include "render/affine/affine_splats.h"

namespace tg {

// Bakes no textures: give it what the viewer reads (core/model/fallback.h).
class ViewerPicture {
 public:
  // `parts`: as keepSplats has them.
  ViewerPicture(const GaussianModel& base, SplatViewer viewer, std::span<const std::size_t> parts = {});
  // 3 channels, blended in 8 bits as on the viewer's canvas. `shrink`: of the picture against the one it stands for.
  Image render(const Pinhole& camera, glm::vec3 background, float shrink = 1.0f) const;

 private:
  SplatViewer viewer_;
  KeptSplats splats_;
};

// dL/d(...) of a splat that is seen.
struct AffineGradient {
  float opacity = 0;           // before compensation
  glm::vec3 color{0.0f};       // before clamps: 0 where they act
  glm::vec2 center{0.0f};      // [1/px]
  glm::vec3 covariance{0.0f};  // [1/px^2] xx, xy, yy, before the blur
  AffineGradient& operator+=(const AffineGradient& other);
};

// L = the mean over pixels and channels of the square of picture - target; the picture without rounding. `gradients`
// gets dL of every one of `seen`. The target has the camera's size and 3 channels.
double affineLoss(std::span<const AffineSplat> seen, SplatViewer viewer, const AffineView& view, glm::vec3 background,
                  const Image& target, std::vector<AffineGradient>& gradients);

}  // namespace tg
