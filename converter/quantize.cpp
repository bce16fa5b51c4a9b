// SPDX-License-Identifier: Apache-2.0
// Atlas texels as bytes.
#include "converter/quantize.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tg {
namespace {

constexpr double kLevels = 255.0;
constexpr double kZeroByte = 128.0;  // of a signed channel
constexpr double kPercentile = 0.999;

struct Range {
  double scale = 1.0;
  double offset = 0.0;
};

// The bytes of a range whose largest positive value is `magnitude`.
Range rangeFor(double magnitude, bool is_signed) {
  if (!(magnitude > 0.0)) return {};
  const double scale = is_signed ? magnitude * kLevels / (kLevels - kZeroByte) : magnitude;
  return {scale, is_signed ? -(kZeroByte * scale / kLevels) : 0.0};
}

double byteOf(double value, const Range& range) {
  return std::clamp(std::round((value - range.offset) / range.scale * kLevels), 0.0, kLevels);
}

double valueOf(double byte, const Range& range) { return byte * range.scale / kLevels + range.offset; }

bool isClipped(double value, const Range& range) {
  const double half_step = 0.5 * range.scale / kLevels;
  return value < range.offset - half_step || value > range.offset + range.scale + half_step;
}

double squaredError(const AtlasPage& page, int channel, const Range& range) {
  double sum = 0.0;
  for (const glm::vec4& texel : page.texels) {
    const double difference = texel[channel] - valueOf(byteOf(texel[channel], range), range);
    sum += difference * difference;
  }
  return sum;
}

Range chooseRange(const AtlasPage& page, int channel) {
  std::vector<float> magnitudes;
  bool is_signed = false;
  for (const glm::vec4& texel : page.texels) {
    if (texel[channel] == 0.0f) continue;  // exact in any range; free texels are 0
    magnitudes.push_back(std::abs(texel[channel]));
    is_signed = is_signed || texel[channel] < 0.0f;
  }
  if (magnitudes.empty()) return {};
  const Range widest = rangeFor(*std::max_element(magnitudes.begin(), magnitudes.end()), is_signed);
  const auto percentile =
      magnitudes.begin() + static_cast<std::ptrdiff_t>(kPercentile * static_cast<double>(magnitudes.size() - 1));
  std::nth_element(magnitudes.begin(), percentile, magnitudes.end());
  const Range narrow = rangeFor(*percentile, is_signed);
  return squaredError(page, channel, narrow) < squaredError(page, channel, widest) ? narrow : widest;
}

}  // namespace

QuantizedPage quantizePage(const AtlasPage& page) {
  QuantizedPage out;
  out.color = Image(page.width, page.height, 3);
  out.alpha = Image(page.width, page.height, 1);
  std::array<Range, 4> ranges;
  for (int c = 0; c < 3; ++c) ranges[c] = chooseRange(page, c);
  for (int c = 0; c < 4; ++c) {
    out.scale[c] = ranges[c].scale;
    out.offset[c] = ranges[c].offset;
  }
  for (std::size_t i = 0; i < page.texels.size(); ++i) {
    const glm::vec4& texel = page.texels[i];
    bool clipped = false;
    for (int c = 0; c < 4; ++c) {
      const auto stored = static_cast<float>(byteOf(texel[c], ranges[c]) / kLevels);
      (c < 3 ? out.color.data[i * 3 + c] : out.alpha.data[i]) = stored;
      clipped = clipped || isClipped(texel[c], ranges[c]);
    }
    if (clipped) ++out.clipped_texels;
  }
  return out;
}

}  // namespace tg
