// SPDX-License-Identifier: Apache-2.0
// Atlas texels as integers.
#include "converter/gltf/quantize.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "converter/formats/texel_spread.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"

namespace tg {
namespace {

struct Levels {
  double largest;
  double zero;  // of a signed channel
};
Levels levelsOf(int bits) { return bits == 16 ? Levels{65535.0, 32768.0} : Levels{255.0, 128.0}; }

struct Range {
  double scale = 1.0;
  double offset = 0.0;
};

// The range whose largest positive value is `magnitude`, or as near as floats, which readers take, hold its scale.
Range rangeFor(double magnitude, bool is_signed, const Levels& levels) {
  if (!(magnitude > 0.0)) return {};
  const double wanted = is_signed ? magnitude * levels.largest / (levels.largest - levels.zero) : magnitude;
  const double scale = std::min(wanted, double{std::numeric_limits<float>::max()});
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
  const Range narrow = rangeFor(mostOf(magnitudes), is_signed, levels);
  return squaredError(page, channel, narrow, levels) < squaredError(page, channel, widest, levels) ? narrow : widest;
}

double alphaUnit(const TexelSteps& steps) { return std::max(2 * steps.step, 1.0 / 255); }

QuantizedPage quantizedBy(const Image& page, const std::array<Range, 4>& ranges, const Levels& levels) {
  QuantizedPage out;
  out.color = Image(page.width, page.height, 3);
  out.alpha = Image(page.width, page.height, 1);
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

}  // namespace

QuantizedPage quantizePage(const Image& page, int bits) {
  TG_ASSERT(bits == 8 || bits == 16, "8 or 16 bits a channel");
  const Levels levels = levelsOf(bits);
  std::array<Range, 4> ranges;
  for (int c = 0; c < 3; ++c) ranges[c] = chooseRange(page, c, levels);
  return quantizedBy(page, ranges, levels);
}

TexelSteps texelStepsOf(const TextureAtlas& atlas, double step) {
  TG_ASSERT(step > 0, "steps have a width");
  TexelSteps steps{step, {step, step, step}};
  for (int c = 0; c < 3; ++c) {
    std::vector<float> magnitudes;
    for (const glm::vec4& texel : atlas.texels) magnitudes.push_back(std::abs(texel[c]));
    if (magnitudes.empty()) continue;
    steps.units[c] = reachingStep(step, static_cast<double>(mostOf(magnitudes)));
  }
  return steps;
}

TextureAtlas texelsInSteps(const GaussianModel& model, const GaussianModel& base, const TexelSteps& steps) {
  TG_ASSERT(base.size() == model.size(), "the base has the model's Gaussians");
  TextureAtlas atlas = model.atlas;
  std::map<std::pair<int, int>, std::vector<double>> spreads;  // by size
  for (std::size_t i = 0; i < atlas.rects.size(); ++i) {
    const TextureRect rect = atlas.rects[i];
    if (rect.texelCount() == 0) continue;
    std::vector<double>& own = spreads[{rect.width, rect.height}];
    if (own.empty()) own = texelSpreads(rect.width, rect.height);
    const double weight = opacitySpread(opacityOf(base, i));
    for (std::uint32_t t = 0; t < rect.texelCount(); ++t) {
      // Powers of 2 of what is stored: texels of all weights then have numbers in common, which is what coders live on,
      // and none is rounded twice, which sends all halves outwards.
      const auto rounded = [&](double value, double wanted, double stored) {
        const double unit = stored * std::exp2(std::max(std::round(std::log2(wanted * own[t] * weight / stored)), 0.0));
        return wholeSteps(value / unit) * unit;
      };
      glm::vec4& texel = atlas.texels[rect.offset + t];
      for (int c = 0; c < 3; ++c) texel[c] = static_cast<float>(rounded(texel[c], steps.step, steps.units[c]));
      texel.a = static_cast<float>(std::max(1 + rounded(texel.a - 1, 2 * steps.step, alphaUnit(steps)), 0.0));
    }
  }
  return atlas;
}

TextureAtlas withinReach(TextureAtlas atlas, const TexelSteps& steps) {
  const Levels levels = levelsOf(8);
  for (glm::vec4& texel : atlas.texels) {
    for (int c = 0; c < 3; ++c) {
      texel[c] = static_cast<float>(std::clamp(static_cast<double>(texel[c]), -levels.zero * steps.units[c],
                                               (levels.largest - levels.zero) * steps.units[c]));
    }
  }
  return atlas;
}

QuantizedPage quantizePage(const Image& page, const TexelSteps& steps) {
  const Levels levels = levelsOf(8);
  std::array<Range, 4> ranges;
  for (int c = 0; c < 3; ++c) ranges[c] = rangeFor(steps.units[c] * (levels.largest - levels.zero), true, levels);
  const double scale = alphaUnit(steps) * levels.largest;
  ranges[3] = {scale, 1 - scale};
  return quantizedBy(page, ranges, levels);
}

}  // namespace tg
