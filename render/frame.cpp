// SPDX-License-Identifier: Apache-2.0
// The outputs of a frame as numbers and as pictures for people.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <type_traits>
#include <vector>

#include "core/image/color_map.h"
#include "core/system/error.h"
#include "render/renderer.h"
#include "shared/limits.h"

namespace tg {
namespace {

constexpr OutputSet outputsOfPlanes() {
  OutputSet outputs;
  forEachPlane([&](Output output) { outputs = outputs | OutputSet{output}; });
  return outputs;
}
static_assert(outputsOfPlanes() == kAllOutputs, "forEachPlane (render/renderer.h) has a line for each output");

// Null where an output's pixels are of another kind.
template <typename T>
const std::vector<T>* planeOf(const Frame& frame, Output output) {
  const std::vector<T>* found = nullptr;
  const auto look = [&](Output plane, const auto& pixels) {
    if constexpr (std::is_convertible_v<decltype(&pixels), const std::vector<T>*>) {
      if (plane == output) found = &pixels;
    }
  };
  forEachPlane(look, frame);
  return found;
}

// The pixels of an output that has one number each; null for colours and normals.
const std::vector<float>* scalars(const Frame& frame, Output output) { return planeOf<float>(frame, output); }

// The pixels of an output that has three; final is their sum where base and texture lie apart.
const std::vector<glm::vec3>& colors(const Frame& frame, Output output) {
  if (output == Output::final && !frame.base.empty()) return frame.base;
  return *planeOf<glm::vec3>(frame, output);
}

void requireOutput(const Frame& frame, Output output) {
  const auto* numbers = scalars(frame, output);
  const bool empty = numbers ? numbers->empty() : colors(frame, output).empty();
  if (empty && frame.width > 0 && frame.height > 0) {
    throw Error(ErrorKind::usage, "frame",
                "no output \"" + std::string(name(output)) + "\" (expected it in RenderSettings::outputs)");
  }
}

constexpr bool isDepth(Output output) { return output == Output::depth || output == Output::depthMedian; }

// Over the pixels that are not 0; (0, 0) when there are none.
glm::vec2 rangeOf(const std::vector<float>& numbers) {
  glm::vec2 range(std::numeric_limits<float>::max(), 0.0f);
  for (float x : numbers) {
    if (x > 0.0f) range = {std::min(range.x, x), std::max(range.y, x)};
  }
  return range.y > 0.0f ? range : glm::vec2(0.0f);
}

// The numbers that so many percent of those above 0 lie below.
glm::vec2 percentiles(const std::vector<float>& numbers, PercentRange range) {
  std::vector<float> positive;
  std::ranges::copy_if(numbers, std::back_inserter(positive), [](float x) { return x > 0.0f; });
  if (positive.empty()) return glm::vec2(0.0f);
  const auto at = [&](float percent) {
    const auto place = std::lround(static_cast<double>(percent) / 100 * static_cast<double>(positive.size() - 1));
    std::nth_element(positive.begin(), positive.begin() + place, positive.end());
    return positive[static_cast<std::size_t>(place)];
  };
  return {at(range.low), at(range.high)};
}

// In [0, 1] of a number above 0.
float placeOn(const ValueScale& scale, float x) {
  float low = scale.low, high = scale.high;
  if (scale.logarithmic) {
    x = std::log2(x);
    low = std::log2(low);
    high = std::log2(high);
  }
  const float at_once = scale.near_is_bright ? 0.0f : 1.0f;  // where all numbers are one
  return high > low ? std::clamp((x - low) / (high - low), 0.0f, 1.0f) : at_once;
}

glm::vec3 numberColor(Output output, const RenderSettings& settings, const ValueScale& scale, float x) {
  if (x <= 0.0f) return glm::vec3(0.0f);  // nothing is there
  return scaleColor(output, settings.colors, placeOn(scale, x));
}

ValueScale scaleOf(const std::vector<float>& numbers, Output output, const RenderSettings& settings) {
  const bool whole = settings.range == PercentRange{};
  const glm::vec2 range = whole ? rangeOf(numbers) : percentiles(numbers, settings.range);
  ValueScale scale = ownScale(output, range.x, range.y);
  if (!whole) {
    scale.low = range.x;
    scale.high = range.y;
  }
  return scale;
}

Image colored(const Frame& frame, Output output, const RenderSettings& settings, const ValueScale& scale) {
  const std::vector<float>& numbers = *scalars(frame, output);
  Image image(frame.width, frame.height, 3);
  for (std::size_t i = 0; i < image.data.size() / 3; ++i) {
    const glm::vec3 color = numberColor(output, settings, scale, numbers[i]);
    for (int c = 0; c < 3; ++c) image.data[i * 3 + c] = std::clamp(color[c], 0.0f, 1.0f);
  }
  return image;
}

}  // namespace

ValueScale ownScale(Output output, float least, float most) {
  if (isDepth(output)) return {least, most, false, true};
  if (output == Output::texelDensity) return {kLowestDensity, kHighestDensity, true, false};
  return {0.0f, output == Output::alpha ? 1.0f : most, false, false};
}

glm::vec3 scaleColor(Output output, Colors colors, float place) {
  if (colors == Colors::automatic) {
    if (isDepth(output)) return glm::vec3(1.0f - (1.0f - kFarthestGrey) * place);
    return colorOf(output == Output::alpha ? ColorMap::grey : ColorMap::heat, place);
  }
  if (colors == Colors::grey && isDepth(output)) return scaleColor(output, Colors::automatic, place);
  const float x = isDepth(output) ? 1.0f - place : place;
  return colorOf(colors == Colors::turbo     ? ColorMap::turbo
                 : colors == Colors::viridis ? ColorMap::viridis
                                             : ColorMap::grey,
                 x);
}

bool mapsOnHost(Output output, const RenderSettings& settings) {
  return kNumberOutputs.has(output) && (settings.colors != Colors::automatic || settings.range != PercentRange{});
}

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

Image visualize(const Frame& frame, Output output, const RenderSettings& settings, ValueScale* scale) {
  requireOutput(frame, output);
  if (const auto* numbers = scalars(frame, output)) {
    const ValueScale shown = scaleOf(*numbers, output, settings);
    if (scale) *scale = shown;
    return colored(frame, output, settings, shown);
  }
  Image image(frame.width, frame.height, 3);
  const std::size_t pixels = image.data.size() / 3;
  const auto put = [&](std::size_t pixel, glm::vec3 value) {
    for (int c = 0; c < 3; ++c) image.data[pixel * 3 + c] = std::clamp(value[c], 0.0f, 1.0f);
  };
  const std::vector<glm::vec3>& values = colors(frame, output);
  const float exposure = std::exp2(settings.exposure);
  for (std::size_t i = 0; i < pixels; ++i) {
    glm::vec3 value = output == Output::final ? frame.color(i) : values[i];
    if (output == Output::final || output == Output::base) value *= exposure;
    if (output == Output::texture) value *= settings.gain;
    if (output == Output::normal) value *= glm::vec3(1, -1, -1);
    if (output == Output::normal || output == Output::texture) value = 0.5f + 0.5f * value;
    put(i, value);
  }
  return image;
}

std::array<Image, 2> visualizeBoth(const Frame& first, const Frame& other, Output output,
                                   const RenderSettings& settings, ValueScale& scale) {
  TG_ASSERT(kNumberOutputs.has(output), "an output of one number a pixel has a scale");
  requireOutput(first, output);
  requireOutput(other, output);
  scale = scaleOf(*scalars(first, output), output, settings);
  const ValueScale second = scaleOf(*scalars(other, output), output, settings);
  if (!(scale.high > 0)) scale = second;
  if (second.high > 0) {
    scale.low = std::min(scale.low, second.low);
    scale.high = std::max(scale.high, second.high);
  }
  return {colored(first, output, settings, scale), colored(other, output, settings, scale)};
}

}  // namespace tg
