// SPDX-License-Identifier: Apache-2.0
// The built-in scene: printed boards, a box and a sphere, ray-cast in float64 from cameras around them.
#pragma once
#include <filesystem>

#include "core/bundle/ply.h"
#include "core/image/image.h"
#include "core/model/camera.h"

namespace tg {

struct SampleOptions {
  int size = 128;  // [px] images are square
  int train_views = 60;
  int test_views = 12;
  int points = 8000;      // exact surface points
  int supersampling = 4;  // rays per pixel and axis
  int grid = 1;  // so many of the scene a side, turned and in other colours, views and points shared among them
};

// One camera of the set; `index` within its split.
Camera sampleCamera(const SampleOptions& options, bool test, int index);
// What it sees: RGBA, straight alpha, transparent where nothing is hit.
Image renderSample(const SampleOptions& options, const Camera& camera);
// Points on the surfaces with their colours, evenly spread by area.
PointCloud samplePoints(const SampleOptions& options);

// The NeRF-synthetic layout: transforms_train.json, transforms_test.json, train/r_*.png, test/r_*.png, and
// points3d.ply. Same options, same bytes. Throws Error(usage) for options out of range, Error(cannotWrite) when
// `folder` holds a data set already and `overwrite` is not set. Without that it is then as it was.
void writeSample(const std::filesystem::path& folder, const SampleOptions& options, bool overwrite);

}  // namespace tg
