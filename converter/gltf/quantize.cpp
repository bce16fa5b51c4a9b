// SPDX-License-Identifier: Apache-2.0
// Atlas texels as integers.
#include "converter/gltf/quantize.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "core/system/assert.h"

namespace tg {
namespace {

constexpr double kPercentile = 0.999;

struct Levels {
  double largest;
  double zero;  // of a signed channel
};
Levels levelsOf(int bits) { return bits == 16 ? Levels{65535.0, 32768.0} : Levels{255.0, 128.0}; }

struct Range {
  double scale = 1.0;
  double offset = 0.0;
};

// The range whose largest positive value is `magnitude`.
Range rangeFor(double magnitude, bool is_signed, const Levels& levels) {
  if (!(magnitude > 0.0)) return {};
  const double scale = is_signed ? magnitude * levels.largest / (levels.largest - levels.zero) : magnitude;
  return {scale, is_signed ? -(levels.zero * scale / levels.largest) : 0.0};
}

double storedFor(double value, const Range& range, const Levels& levels) {
  return std::clamp(std::round((value - range.offset) / range.scale * levels.largest), 0.0, levels.largest);
}

double valueOf(double stored, const Range& range, const Levels& levels) {
  return stored * range.scale / levels.largest + range.offset;
}

bool isClipped(double value, const Range& range, const Levels& levels) {
  const double half_step = 0.5 * range.scale / levels.largest;
  return value < range.offset - half_step || value > range.offset + range.scale + half_step;
}

double squaredError(const Image& page, int channel, const Range& range, const Levels& levels) {
  double sum = 0.0;
  for (const glm::vec4& texel : pageTexels(page)) {
    const double difference = texel[channel] - valueOf(storedFor(texel[channel], range, levels), range, levels);
    sum += difference * difference;
  }
  return sum;
}

Range chooseRange(const Image& page, int channel, const Levels& levels) {
  std::vector<float> magnitudes;
  bool is_signed = false;
  for (const glm::vec4& texel : pageTexels(page)) {
    if (texel[channel] == 0.0f) continue;  // exact in any range; free texels are 0
    magnitudes.push_back(std::abs(texel[channel]));
    is_signed = is_signed || texel[channel] < 0.0f;
  }
  if (magnitudes.empty()) return {};
  const Range widest = rangeFor(*std::max_element(magnitudes.begin(), magnitudes.end()), is_signed, levels);
  const auto percentile =
      magnitudes.begin() + static_cast<std::ptrdiff_t>(kPercentile * static_cast<double>(magnitudes.size() - 1));
  std::nth_element(magnitudes.begin(), percentile, magnitudes.end());
  const Range narrow = rangeFor(*percentile, is_signed, levels);
  return squaredError(page, channel, narrow, levels) < squaredError(page, channel, widest, levels) ? narrow : widest;
}

}  // namespace

QuantizedPage quantizePage(const Image& page, int bits) {
  TG_ASSERT(bits == 8 || bits == 16, "8 or 16 bits a channel");
  const Levels levels = levelsOf(bits);
  QuantizedPage out;
  out.color = Image(page.width, page.height, 3);
  out.alpha = Image(page.width, page.height, 1);
  std::array<Range, 4> ranges;
  for (int c = 0; c < 3; ++c) ranges[c] = chooseRange(page, c, levels);
  for (int c = 0; c < 4; ++c) {
    out.scale[c] = ranges[c].scale;
    out.offset[c] = ranges[c].offset;
  }
  const std::span texels = pageTexels(page);
  for (std::size_t i = 0; i < texels.size(); ++i) {
    const glm::vec4& texel = texels[i];
    bool clipped = false;
    for (int c = 0; c < 4; ++c) {
      const auto stored = static_cast<float>(storedFor(texel[c], ranges[c], levels) / levels.largest);
      (c < 3 ? out.color.data[i * 3 + c] : out.alpha.data[i]) = stored;
      clipped = clipped || isClipped(texel[c], ranges[c], levels);
    }
    if (clipped) ++out.clipped_texels;
  }
  return out;
}

}  // namespace tg
