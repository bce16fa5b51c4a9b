// SPDX-License-Identifier: Apache-2.0
// A photograph's or a view's camera.
#pragma once
#include <string>

#include "core/model/pinhole.h"

namespace tg {

struct Camera : Pinhole {
  std::string name;   // of the image, without path; may be empty
  bool test = false;  // held out from training
};

// A camera at `eye` that looks at `target`; `up` points to the image's top. Intrinsics from the vertical field of view.
Camera lookAt(glm::dvec3 eye, glm::dvec3 target, glm::dvec3 up, double fov_y_radians, int width, int height);

// The same view at another image size: intrinsics scaled per axis.
Camera resized(const Camera& camera, int width, int height);
// The same view `scale` times as large around the image's middle, in an image of another size.
Camera scaled(const Camera& camera, double scale, int width, int height);

}  // namespace tg
