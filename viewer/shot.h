// SPDX-License-Identifier: Apache-2.0
// What --path and --turntable ask for: the cameras of all frames.
#pragma once
#include <vector>

#include "viewer/options.h"

namespace tg {

// Where a turntable begins: the view of --camera, or one at --elevation and --radius that looks at the model's centre.
ViewPose turntableStart(const ViewOptions& options, const Scene& scene, const Camera& camera);

// At --size, else at the size of the camera that a turntable begins with, or 720 rows of a path's aspect; with `even`,
// enlarged by a pixel where a side is odd. Throws Error(usage), and what readPath throws.
std::vector<Camera> shotCameras(const ViewOptions& options, const Scene& scene, bool even);

}  // namespace tg
