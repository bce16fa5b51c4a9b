// SPDX-License-Identifier: Apache-2.0
// A base made for somebody else's viewer: numbers that look there as the model should look.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "converter/edit/progress.h"
#include "core/image/image.h"
#include "core/model/camera.h"
#include "core/model/model.h"
#include "render/affine/splat_viewer.h"

namespace tg {

// Cameras with the pictures that a viewer should show from them.
struct FitViews {
  std::vector<Camera> cameras;
  std::vector<Image> pictures;  // 3 channels
  std::vector<float> shrink;    // of each camera's size against that at which viewers show it
  glm::vec3 background{0.0f};
};

// What our renderer shows of `model`, at most `max_side` pixels a side.
FitViews fitViews(const GaussianModel& model, std::span<const Camera> cameras, glm::vec3 background, int max_side);

// PSNR [dB] of all pixels together of what the viewer shows of `base`.
double viewerPsnr(const GaussianModel& base, SplatViewer viewer, const FitViews& views,
                  std::span<const std::size_t> parts = {});

struct FitSettings {
  int steps = 0;
  // [N] not 0: opacity, DC colour and scale alone move; 0 where it ends.
  std::vector<std::uint8_t> fixed = {};
  std::vector<std::size_t> parts = {};  // as keepSplats has them
};

// Moves opacities, colours, places and scales so that the viewer's pictures come close to those of `views`, by Adam.
// What is invisible stays so. `listener`: may be empty.
void fitToViewer(GaussianModel& base, SplatViewer viewer, const FitViews& views, const FitSettings& settings,
                 const ConvertListener& listener = {});

}  // namespace tg
