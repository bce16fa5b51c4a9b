// SPDX-License-Identifier: Apache-2.0
// BT.2100's curves, two matrices, and the curve that presses highlights.
#include "training/photos/hdr.h"

#include <algorithm>
#include <cmath>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "core/system/assert.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

// To linear light, 1 is paper white.
double fromPq(double signal) {
  const double root = std::pow(std::max(signal, 0.0), 32 / 2523.0);
  const double light = std::max(root - 3424 / 4096.0, 0.0) / (2413 / 128.0 - 2392 / 128.0 * root);
  return std::pow(light, 8192 / 1305.0) * 10000 / kPaperWhite;
}
double sceneOfHlg(double signal) {
  constexpr double a = 0.17883277, b = 0.28466892, c = 0.55991073;
  const double positive = std::max(signal, 0.0);
  return positive <= 0.5 ? positive * positive / 3 : (std::exp((positive - c) / a) + b) / 12;
}
glm::dvec3 fromHlg(const glm::dvec3& signal) {
  const glm::dvec3 scene(sceneOfHlg(signal.x), sceneOfHlg(signal.y), sceneOfHlg(signal.z));
  const double luminance = 0.2627 * scene.x + 0.6780 * scene.y + 0.0593 * scene.z;
  return scene * (std::pow(luminance, 0.2) * kBrightest / kPaperWhite);  // gamma 1.2, of a screen of 1,000 cd/m2
}

// Linear light of these primaries to that of BT.709's, both with D65.
glm::dmat3 toBt709(int primaries) {
  if (primaries == 9)
    return {1.660491, -0.124550, -0.018151, -0.587641, 1.132900, -0.100579, -0.072850, -0.008349, 1.118730};
  if (primaries == 12) return {1.224940, -0.042057, -0.019638, -0.224940, 1.042057, -0.078636, 0, 0, 1.098274};
  return glm::dmat3(1);
}

// Goes on from (kUnchanged, kUnchanged) with slope 1 to (peak, 1).
double pressed(double light) {
  constexpr double j = kUnchanged, peak = kBrightest / kPaperWhite;
  constexpr double a = -j * j * (peak - 1) / (j * j - 2 * j + peak), b = (j * j - 2 * j * peak + peak) / (peak - 1);
  return light <= j ? light : (b * b + 2 * b * j + j * j) / (b - a) * (light + a) / (light + b);
}

}  // namespace

Image toneMapped(Image image, Transfer transfer, int primaries) {
  TG_ASSERT(image.channels == 3, "a picture in colour");
  if (transfer == Transfer::sdr) return image;
  const glm::dmat3 to_bt709 = toBt709(primaries);
  parallelFor(image.height, 16, [&](std::int64_t y) {
    for (int x = 0; x < image.width; ++x) {
      float* const pixel = &image.at(x, static_cast<int>(y), 0);
      const glm::dvec3 signal(pixel[0], pixel[1], pixel[2]);
      const glm::dvec3 light = transfer == Transfer::hlg
                                   ? fromHlg(signal)
                                   : glm::dvec3(fromPq(signal.x), fromPq(signal.y), fromPq(signal.z));
      const glm::dvec3 narrow = to_bt709 * light;
      const double largest = std::max({narrow.x, narrow.y, narrow.z, 1e-6});
      const double scale = pressed(largest) / largest;  // the same for the three keeps the hue
      for (int c = 0; c < 3; ++c) {
        pixel[c] = static_cast<float>(std::pow(std::clamp(narrow[c] * scale, 0.0, 1.0), 1 / 2.4));
      }
    }
  });
  return image;
}

}  // namespace tg
