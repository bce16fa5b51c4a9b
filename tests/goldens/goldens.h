// SPDX-License-Identifier: Apache-2.0
// The golden frames: what the reference rendered when someone last looked at it.
#pragma once
#include <string>
#include <vector>

#include "render/renderer.h"

namespace tg::test {

struct Golden {
  std::string name;  // NAME.f32 holds the numbers, NAME.png shows the picture
  FrameT<double> frame;
};

// All of them, rendered now.
std::vector<Golden> renderGoldens();

// What NAME.f32 stores, little endian, all pixels of one output after the other: base, texture, alpha, depth, normal,
// count.
std::vector<float> goldenValues(const FrameT<double>& frame);

FrameT<float> toFloat(const FrameT<double>& frame);

}  // namespace tg::test
