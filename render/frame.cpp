// SPDX-License-Identifier: Apache-2.0
// The outputs of a frame by name, as numbers, and as pictures for people.
#include <algorithm>
#include <array>

#include "render/renderer.h"

namespace tg {
namespace {

constexpr std::array<std::string_view, 7> kOutputNames = {"final", "base",   "texture", "alpha",
                                                          "depth", "normal", "count"};
constexpr float kFarthestGrey = 0.15f;  // so that the farthest hit still differs from nothing at all

void setPixel(Image& image, std::size_t pixel, glm::vec3 value) {
  float* out = image.data.data() + pixel * 3;
  for (int c = 0; c < 3; ++c) out[c] = std::clamp(value[c], 0.0f, 1.0f);
}

// Black, red, yellow, white for x in [0, 1].
glm::vec3 heat(float x) { return {3.0f * x, 3.0f * x - 1.0f, 3.0f * x - 2.0f}; }

// Smallest and largest depth of the pixels that hit something; (0, 0) when none does.
glm::vec2 depthRange(const Frame& frame) {
  glm::vec2 range(0.0f);
  bool first = true;
  for (std::size_t i = 0; i < frame.depth.size(); ++i) {
    if (frame.count[i] <= 0.0f) continue;
    const float z = frame.depth[i];
    range = first ? glm::vec2(z) : glm::vec2(std::min(range.x, z), std::max(range.y, z));
    first = false;
  }
  return range;
}

glm::vec3 depthGrey(float z, bool hit, glm::vec2 range) {
  if (!hit) return glm::vec3(0.0f);
  const float span = range.y - range.x;
  const float x = span > 0.0f ? (z - range.x) / span : 0.0f;
  return glm::vec3(1.0f - (1.0f - kFarthestGrey) * x);
}

}  // namespace

std::string_view name(Output output) { return kOutputNames.at(static_cast<std::size_t>(output)); }

std::optional<Output> parseOutput(std::string_view text) {
  for (std::size_t i = 0; i < kOutputNames.size(); ++i) {
    if (kOutputNames[i] == text) return static_cast<Output>(i);
  }
  return std::nullopt;
}

Image extract(const Frame& frame, Output output) {
  const bool scalar = output == Output::alpha || output == Output::depth || output == Output::count;
  Image image(frame.width, frame.height, scalar ? 1 : 3);
  if (scalar) {
    image.data = output == Output::alpha ? frame.alpha : output == Output::depth ? frame.depth : frame.count;
    return image;
  }
  const std::size_t pixels = frame.base.size();
  for (std::size_t i = 0; i < pixels; ++i) {
    glm::vec3 value;
    switch (output) {
      case Output::base:
        value = frame.base[i];
        break;
      case Output::texture:
        value = frame.texture[i];
        break;
      case Output::normal:
        value = frame.normal[i];
        break;
      default:
        value = frame.color(i);
        break;
    }
    for (int c = 0; c < 3; ++c) image.data[i * 3 + c] = value[c];
  }
  return image;
}

Image visualize(const Frame& frame, Output output) {
  Image image(frame.width, frame.height, 3);
  const std::size_t pixels = frame.base.size();
  const glm::vec2 range = output == Output::depth ? depthRange(frame) : glm::vec2(0.0f);
  float highest = 0.0f;
  if (output == Output::count) {
    for (float count : frame.count) highest = std::max(highest, count);
  }
  for (std::size_t i = 0; i < pixels; ++i) {
    switch (output) {
      case Output::final:
        setPixel(image, i, frame.color(i));
        break;
      case Output::base:
        setPixel(image, i, frame.base[i]);
        break;
      case Output::texture:
        setPixel(image, i, 0.5f + 0.5f * frame.texture[i]);
        break;
      case Output::alpha:
        setPixel(image, i, glm::vec3(frame.alpha[i]));
        break;
      case Output::depth:
        setPixel(image, i, depthGrey(frame.depth[i], frame.count[i] > 0.0f, range));
        break;
      case Output::normal:
        setPixel(image, i, 0.5f + 0.5f * glm::vec3(1, -1, -1) * frame.normal[i]);
        break;
      case Output::count:
        setPixel(image, i, heat(highest > 0.0f ? frame.count[i] / highest : 0.0f));
        break;
    }
  }
  return image;
}

}  // namespace tg
