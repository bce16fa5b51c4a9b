// SPDX-License-Identifier: Apache-2.0
// The outputs of a frame as numbers and as pictures for people.
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/system/error.h"
#include "render/renderer.h"

namespace tg {
namespace {

constexpr float kFarthestGrey = 0.15f;  // so that the farthest hit still differs from nothing at all
// [log2(texels / px)] of black and white
constexpr float kLowestDensity = -6.0f;
constexpr float kHighestDensity = 2.0f;

// Black, red, yellow, white for x in [0, 1].
glm::vec3 heat(float x) { return {3.0f * x, 3.0f * x - 1.0f, 3.0f * x - 2.0f}; }

template <typename T>
struct Plane {
  Output output;
  std::vector<T> Frame::* pixels;
};
constexpr Plane<float> kScalars[] = {
    {Output::alpha, &Frame::alpha},       {Output::depth, &Frame::depth},
    {Output::count, &Frame::count},       {Output::depthMedian, &Frame::depth_median},
    {Output::overdraw, &Frame::overdraw}, {Output::texelDensity, &Frame::texel_density}};
constexpr Plane<glm::vec3> kColors[] = {{Output::base, &Frame::base},
                                        {Output::texture, &Frame::texture},
                                        {Output::normal, &Frame::normal},
                                        {Output::ellipsoids, &Frame::ellipsoids},
                                        {Output::centers, &Frame::centers}};

// The pixels of an output that has one number each; null for colours and normals.
const std::vector<float>* scalars(const Frame& frame, Output output) {
  const auto* plane = std::ranges::find(kScalars, output, &Plane<float>::output);
  return plane == std::end(kScalars) ? nullptr : &(frame.*plane->pixels);
}

// The pixels of an output that has three; final is their sum where base and texture lie apart.
const std::vector<glm::vec3>& colors(const Frame& frame, Output output) {
  const auto* plane = std::ranges::find(kColors, output, &Plane<glm::vec3>::output);
  if (plane != std::end(kColors)) return frame.*plane->pixels;
  return frame.base.empty() ? frame.picture : frame.base;
}

void requireOutput(const Frame& frame, Output output) {
  const auto* numbers = scalars(frame, output);
  const bool empty = numbers ? numbers->empty() : colors(frame, output).empty();
  if (empty && frame.width > 0 && frame.height > 0) {
    throw Error(ErrorKind::usage, "frame",
                "no output \"" + std::string(name(output)) + "\" (expected it in RenderSettings::outputs)");
  }
}

// How the numbers of a frame map to heat or grey: the range over its pixels that are not 0; (0, 0) when there are none.
glm::vec2 rangeOf(const std::vector<float>& numbers) {
  glm::vec2 range(std::numeric_limits<float>::max(), 0.0f);
  for (float x : numbers) {
    if (x > 0.0f) range = {std::min(range.x, x), std::max(range.y, x)};
  }
  return range.y > 0.0f ? range : glm::vec2(0.0f);
}

glm::vec3 depthGrey(float z, glm::vec2 range) {
  if (z <= 0.0f) return glm::vec3(0.0f);
  const float span = range.y - range.x;
  const float x = span > 0.0f ? (z - range.x) / span : 0.0f;
  return glm::vec3(1.0f - (1.0f - kFarthestGrey) * x);
}

glm::vec3 numberColor(Output output, float x, glm::vec2 range) {
  if (output == Output::depth || output == Output::depthMedian) return depthGrey(x, range);
  if (output == Output::count || output == Output::overdraw) return heat(range.y > 0.0f ? x / range.y : 0.0f);
  if (output != Output::texelDensity) return glm::vec3(x);
  return heat(x > 0.0f ? (std::log2(x) - kLowestDensity) / (kHighestDensity - kLowestDensity) : 0.0f);
}

}  // namespace

Image extract(const Frame& frame, Output output) {
  requireOutput(frame, output);
  if (const auto* numbers = scalars(frame, output)) {
    Image image(frame.width, frame.height, 1);
    image.data = *numbers;
    return image;
  }
  const std::vector<glm::vec3>& values = colors(frame, output);
  Image image(frame.width, frame.height, 3);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const glm::vec3 value = output == Output::final ? frame.color(i) : values[i];
    for (int c = 0; c < 3; ++c) image.data[i * 3 + c] = value[c];
  }
  return image;
}

Image visualize(const Frame& frame, Output output, float exposure_stops) {
  requireOutput(frame, output);
  Image image(frame.width, frame.height, 3);
  const std::size_t pixels = image.data.size() / 3;
  const auto put = [&](std::size_t pixel, glm::vec3 value) {
    for (int c = 0; c < 3; ++c) image.data[pixel * 3 + c] = std::clamp(value[c], 0.0f, 1.0f);
  };
  if (const auto* numbers = scalars(frame, output)) {
    const glm::vec2 range = rangeOf(*numbers);
    for (std::size_t i = 0; i < pixels; ++i) put(i, numberColor(output, (*numbers)[i], range));
    return image;
  }
  const std::vector<glm::vec3>& values = colors(frame, output);
  const float exposure = std::exp2(exposure_stops);
  for (std::size_t i = 0; i < pixels; ++i) {
    glm::vec3 value = output == Output::final ? frame.color(i) : values[i];
    if (output == Output::final || output == Output::base) value *= exposure;
    if (output == Output::normal) value *= glm::vec3(1, -1, -1);
    if (output == Output::normal || output == Output::texture) value = 0.5f + 0.5f * value;
    put(i, value);
  }
  return image;
}

}  // namespace tg
