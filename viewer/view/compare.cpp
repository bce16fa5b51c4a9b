// SPDX-License-Identifier: Apache-2.0
// Differences, compositions, and a photograph in the view's pixels.
#include "viewer/view/compare.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "core/image/color_map.h"
#include "core/image/flip.h"
#include "core/image/metrics.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr int kMaxTaps = 16;  // per side and pixel, of a photograph that gets smaller

// Bilinear at a place in the image [px], pixel centres at +0.5, edges repeated.
glm::vec3 bilinear(const Image& image, glm::dvec2 at) {
  const glm::dvec2 low = glm::floor(at - 0.5);
  const glm::vec2 t(at - 0.5 - low);
  const auto tap = [&](int dx, int dy) {
    const int px = std::clamp(static_cast<int>(low.x) + dx, 0, image.width - 1);
    const int py = std::clamp(static_cast<int>(low.y) + dy, 0, image.height - 1);
    return glm::vec3(image.at(px, py, 0), image.at(px, py, 1), image.at(px, py, 2));
  };
  return glm::mix(glm::mix(tap(0, 0), tap(1, 0), t.x), glm::mix(tap(0, 1), tap(1, 1), t.x), t.y);
}

Image threeChannels(const Image& image, glm::vec3 background) {
  if (image.channels == 4) return compositeOver(image, &background.x);
  if (image.channels == 3) return image;
  Image result(image.width, image.height, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) result.data[3 * i + c] = image.data[i];
  }
  return result;
}

// What the mask's pixels lie in; all of the picture without a mask.
struct Part {
  glm::ivec2 begin{0}, end{0};
};

Part partOf(const Image& image, const std::vector<std::uint8_t>& mask) {
  if (mask.empty()) return {{0, 0}, {image.width, image.height}};
  Part part{{image.width, image.height}, {0, 0}};
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (mask[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x)] ==
          0) {
        continue;
      }
      part.begin = glm::min(part.begin, glm::ivec2(x, y));
      part.end = glm::max(part.end, glm::ivec2(x + 1, y + 1));
    }
  }
  return part;
}

// Black where the mask says that nothing counts, as tgeval has it.
Image cut(const Image& image, const Part& part, const std::vector<std::uint8_t>& mask) {
  const glm::ivec2 size = part.end - part.begin;
  Image result(size.x, size.y, image.channels);
  for (int y = 0; y < size.y; ++y) {
    for (int x = 0; x < size.x; ++x) {
      const glm::ivec2 from = part.begin + glm::ivec2(x, y);
      const auto i =
          static_cast<std::size_t>(from.y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(from.x);
      for (int c = 0; c < image.channels; ++c) {
        result.at(x, y, c) = mask.empty() || mask[i] ? image.at(from.x, from.y, c) : 0.0f;
      }
    }
  }
  return result;
}

// Of the pixels that count, with nothing of what lies beside them; 0 there. FLIP looks at the surroundings of a pixel.
Image flipWithin(const Image& first, const Image& other, const std::vector<std::uint8_t>& mask) {
  const Part part = partOf(first, mask);
  Image result(first.width, first.height, 1);
  if (part.begin.x >= part.end.x) return result;
  const Image map = flipMap(cut(other, part, mask), cut(first, part, mask));
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) result.at(part.begin.x + x, part.begin.y + y, 0) = map.at(x, y, 0);
  }
  return result;
}

// Pixels of the photograph per pixel of its camera. A whole number where the camera has so many times fewer, but for
// those at the end that fill none: --downscale cuts them.
glm::dvec2 photographScale(glm::ivec2 photograph, glm::ivec2 taken) {
  const glm::ivec2 whole = photograph / taken;
  const bool cut = whole.x == whole.y && whole.x >= 1 && glm::all(glm::lessThan(photograph - whole * taken, whole));
  return cut ? glm::dvec2(whole) : glm::dvec2(photograph) / glm::dvec2(taken);
}

}  // namespace

int sideWidth(int width) { return std::max(width / 2, 1); }

Image differenceOf(const Image& first, const Image& other, const std::vector<std::uint8_t>& mask,
                   const Comparison& how) {
  TG_ASSERT(first.width == other.width && first.height == other.height && first.channels == 3 && other.channels == 3,
            "two pictures of one size and 3 channels");
  TG_ASSERT(hasImageShape(first) && hasImageShape(other), "the images' data has their size");
  TG_ASSERT(mask.empty() || mask.size() == first.data.size() / 3, "a mask has the picture's size");
  Image result(first.width, first.height, 3);
  const std::size_t row = static_cast<std::size_t>(first.width);
  parallelFor(first.height, 16, [&](std::int64_t y) {
    for (std::size_t i = static_cast<std::size_t>(y) * row; i < (static_cast<std::size_t>(y) + 1) * row; ++i) {
      for (std::size_t c = 3 * i; c < 3 * i + 3; ++c) {
        const float apart = mask.empty() || mask[i] ? how.gain * (other.data[c] - first.data[c]) : 0.0f;
        result.data[c] = std::clamp(how.with_sign ? 0.5f + 0.5f * apart : std::abs(apart), 0.0f, 1.0f);
      }
    }
  });
  return result;
}

Image flipOf(const Image& first, const Image& other, const std::vector<std::uint8_t>& mask) {
  TG_ASSERT(first.width == other.width && first.height == other.height && first.channels == 3 && other.channels == 3,
            "two pictures of one size and 3 channels");
  constexpr float kGrey = 0.5f;
  const Image map = flipWithin(first, other, mask);
  Image result(first.width, first.height, 3, kGrey);
  for (std::size_t i = 0; i < map.data.size(); ++i) {
    if (!mask.empty() && !mask[i]) continue;
    const glm::vec3 color = colorOf(ColorMap::magma, map.data[i]);
    for (std::size_t c = 0; c < 3; ++c) result.data[3 * i + c] = color[static_cast<glm::length_t>(c)];
  }
  return result;
}

Image exposedLike(Image photograph, Output output, const RenderSettings& settings) {
  if (settings.exposure == 0 || !kPhotographOutputs.has(output)) return photograph;
  const float factor = std::exp2(settings.exposure);
  for (float& value : photograph.data) value = std::clamp(value * factor, 0.0f, 1.0f);
  return photograph;
}

Image composed(const Image& first, const Image& other, const std::vector<std::uint8_t>& mask, const Comparison& how) {
  TG_ASSERT(first.channels == 3 && other.channels == 3 && first.height == other.height,
            "two pictures of one height and 3 channels");
  switch (how.mode) {
    case CompareMode::off:
      return first;
    case CompareMode::flicker:
      return how.shows_other ? other : first;
    case CompareMode::difference:
      return differenceOf(first, other, mask, how);
    case CompareMode::flip:
      return flipOf(first, other, mask);
    case CompareMode::side:
    case CompareMode::wipe:
      break;
  }
  const bool side = how.mode == CompareMode::side;
  const int divider = side ? first.width : static_cast<int>(std::lround(how.divider * static_cast<float>(first.width)));
  Image result(side ? first.width + other.width : first.width, first.height, 3);
  for (int y = 0; y < result.height; ++y) {
    for (int x = 0; x < result.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        result.at(x, y, c) = x < divider ? first.at(x, y, c) : other.at(side ? x - divider : x, y, c);
      }
    }
  }
  return result;
}

std::optional<PictureMetrics> metricsOf(const Image& first, const Image& other, const std::vector<std::uint8_t>& mask) {
  if (!mask.empty() && std::none_of(mask.begin(), mask.end(), [](std::uint8_t m) { return m != 0; })) {
    return std::nullopt;
  }
  return PictureMetrics{psnr(other, first, mask), ssim(other, first, mask), flip(flipWithin(first, other, mask), mask)};
}

std::string formatMetrics(const PictureMetrics& metrics) {
  char text[96];
  std::snprintf(text, sizeof text, "PSNR %.2f dB, SSIM %.4f, FLIP %.4f", metrics.psnr, metrics.ssim, metrics.flip);
  return text;
}

ResampledPhotograph resampled(const Image& photograph, const Camera& taken, const Camera& view, glm::vec3 background) {
  TG_ASSERT(hasImageShape(photograph), "the image's data has its size");
  TG_ASSERT(taken.size.x > 0 && taken.size.y > 0, "the photograph's camera has a size");
  const Image source = threeChannels(photograph, background);
  const glm::dvec2 scale = photographScale({source.width, source.height}, taken.size);
  const glm::dvec2 covered = scale * glm::dvec2(taken.size);
  // Pixels of the photograph per pixel of the view.
  const glm::dvec2 step = taken.focal * scale / view.focal;
  const auto place = [&](double x, double y) { return project(taken, ray(view, {x, y})) * scale; };
  const int taps_x = std::clamp(static_cast<int>(std::ceil(step.x)), 1, kMaxTaps);
  const int taps_y = std::clamp(static_cast<int>(std::ceil(step.y)), 1, kMaxTaps);

  ResampledPhotograph result{Image(view.size.x, view.size.y, 3),
                             std::vector<std::uint8_t>(static_cast<std::size_t>(view.size.x) * view.size.y)};
  parallelFor(view.size.y, 8, [&](std::int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < view.size.x; ++x) {
      const glm::dvec2 center = place(x + 0.5, y + 0.5);
      const bool inside = center.x >= 0 && center.y >= 0 && center.x < covered.x && center.y < covered.y;
      result.mask[static_cast<std::size_t>(y) * view.size.x + x] = inside;
      glm::vec3 sum(0.0f);
      for (int j = 0; j < taps_y && inside; ++j) {
        for (int i = 0; i < taps_x; ++i) {
          sum += bilinear(source, place(x + (i + 0.5) / taps_x, y + (j + 0.5) / taps_y));
        }
      }
      sum = inside ? sum / static_cast<float>(taps_x * taps_y) : background;
      for (int c = 0; c < 3; ++c) result.image.at(x, y, c) = sum[c];
    }
  });
  return result;
}

}  // namespace tg
