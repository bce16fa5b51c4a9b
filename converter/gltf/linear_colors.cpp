// SPDX-License-Identifier: Apache-2.0
// Colours of linear light as sRGB.
#include "converter/gltf/linear_colors.h"

#include <algorithm>
#include <cmath>

#include "core/model/verbs.h"

namespace tg {
namespace {

constexpr double kC0 = 0.28209479177387814;  // of degree 0
constexpr double kDark = 0.0031308, kDarkSlope = 12.92;

// Odd: what is below 0 darkens what it is mixed with by as much as its opposite lightens it.
double encode(double linear) {
  const double light = std::abs(linear);
  const double code = light <= kDark ? kDarkSlope * light : 1.055 * std::pow(light, 1.0 / 2.4) - 0.055;
  return std::copysign(code, linear);
}

// By how much the code changes with what changes around `color` by `spread`.
double slope(double color, double spread) {
  const double step = std::max(spread, 1e-3);
  return (encode(color + step) - encode(color - step)) / (2.0 * step);
}

}  // namespace

void encodeLinearColors(GaussianModel& model, std::size_t first) {
  const std::size_t count = model.shCount();
  for (std::size_t i = first; i < model.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      glm::vec3* sh = model.sh.data() + i * count;
      const double color = 0.5 + kC0 * static_cast<double>(sh[0][c]);
      double square = 0.0;  // of what depends on the view, integrated over the sphere
      for (std::size_t k = 1; k < count; ++k) square += static_cast<double>(sh[k][c]) * static_cast<double>(sh[k][c]);
      const auto factor = static_cast<float>(slope(color, std::sqrt(square / (4.0 * M_PI))));
      for (std::size_t k = 1; k < count; ++k) sh[k][c] *= factor;
      sh[0][c] = static_cast<float>((encode(color) - 0.5) / kC0);
      if (!isTextured(model)) continue;
      const TextureRect& rect = model.atlas.rects[i];
      for (std::size_t t = 0; t < rect.texelCount(); ++t) {
        float& texel = model.atlas.texels[rect.offset + t][c];
        texel = static_cast<float>(encode(color + static_cast<double>(texel)) - encode(color));
      }
    }
  }
}

}  // namespace tg
