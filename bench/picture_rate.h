// SPDX-License-Identifier: Apache-2.0
// How fast the CPU's picture loop goes, beside what it could do were nothing ever missing: pixel-splats per second and
// core. A pixel-splat is a splat evaluated at one pixel, whether it shows there or not.
#pragma once
#include "core/model/camera.h"
#include "core/model/model.h"
#include "render/renderer.h"

namespace tg {

// [1 / s, one core] The loop over a batch of splats that all cover the tile, its data in the first-level cache. Best of
// many short runs. textured: with 4 x 4 texels each.
double picturePeak(bool textured);
// The same while all threads run it, as they do in a frame: what virtual cores that share a core leave each other.
// Median of the runs of all.
double picturePeakTogether(bool textured);

struct PictureRate {
  double pixel_splats = 0;  // evaluated in a frame
  double seconds = 0;       // processor time of the blending stage, all threads: list sorting and set-up are in it
};
// Median of `frames` frames; settings in the global order, without the footprint filter.
PictureRate pictureRate(const GaussianModel& model, const Camera& camera, const RenderSettings& settings, int frames);

}  // namespace tg
