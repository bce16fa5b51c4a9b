// SPDX-License-Identifier: Apache-2.0
// What the options ask of a scene: the camera and settings of a picture, the cameras of --path and --turntable.
#pragma once
#include <vector>

#include "core/model/camera.h"
#include "viewer/view/options.h"
#include "viewer/view/scene.h"

namespace tg {

// What --camera names, or the view that the window opens with; at --size.
Camera cameraFor(const ViewOptions& options, const Scene& scene);

// What frames are drawn with; `background` is the model's.
RenderSettings settingsFor(const ViewOptions& options, glm::vec3 background);

// Where a turntable begins: the view of --camera, or one at --elevation and --radius that looks at the model's centre.
ViewPose turntableStart(const ViewOptions& options, const Scene& scene, const Camera& camera);

// At --size, else at the size of the camera that a turntable begins with, or 720 rows of a path's aspect; with `even`,
// enlarged by a pixel where a side is odd. Throws Error(usage), and what readPath throws.
std::vector<Camera> shotCameras(const ViewOptions& options, const Scene& scene, bool even);

}  // namespace tg
