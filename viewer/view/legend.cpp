// SPDX-License-Identifier: Apache-2.0
// Words, and letters of lines that need no font.
#include "viewer/view/legend.h"

#include <stb/stb_easy_font.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "core/image/color_map.h"
#include "core/system/error.h"
#include "core/system/numbers.h"

namespace tg {
namespace {

// [units]; a unit is one pixel of a small picture, more of a large one.
constexpr int kMargin = 8, kPadding = 6, kLine = 12, kBar = 10, kBarWidth = 150, kGap = 4;
constexpr int kUnitsHigh = 360;  // of a picture; a larger one has larger units
constexpr float kVeil = 0.75f;   // of black, behind the letters
constexpr float kInk = 1.0f;

const char* titleOf(Output output) {
  switch (output) {
    case Output::alpha:
      return "alpha";
    case Output::depth:
      return "depth [world units]";
    case Output::depthMedian:
      return "median depth [world units]";
    case Output::count:
      return "blended splats a pixel";
    case Output::overdraw:
      return "splats a pixel, hidden ones too";
    case Output::texelDensity:
      return "texels a pixel";
    default:
      return "";
  }
}

std::string number(double value) { return formatted("%.3g", value); }

Legend greyLegend(const std::string& title, double low, double high) {
  return {title, {number(low), number((low + high) / 2), number(high)}, [](float x) { return glm::vec3(x); }};
}

struct Canvas {
  Image& picture;
  int unit;
  glm::ivec2 origin;  // [px]

  // A rectangle in units.
  template <typename Shade>
  void fill(glm::vec2 from, glm::vec2 to, const Shade& shade) const {
    const glm::ivec2 begin = origin + glm::ivec2(from * static_cast<float>(unit));
    const glm::ivec2 end = origin + glm::ivec2(to * static_cast<float>(unit));
    for (int y = std::max(begin.y, 0); y < std::min(end.y, picture.height); ++y) {
      for (int x = std::max(begin.x, 0); x < std::min(end.x, picture.width); ++x) {
        const glm::vec3 old(picture.at(x, y, 0), picture.at(x, y, 1), picture.at(x, y, 2));
        const glm::vec3 color =
            shade(old, static_cast<float>(x - begin.x) / static_cast<float>(std::max(end.x - begin.x - 1, 1)));
        for (int c = 0; c < 3; ++c) picture.at(x, y, c) = color[c];
      }
    }
  }
  void write(glm::vec2 at, std::string text) const {
    struct Vertex {
      float x, y, z;
      unsigned char color[4];
    };
    std::vector<Vertex> vertices(text.size() * 270 / 4);  // the font's own bound: 270 bytes a letter
    const int quads = stb_easy_font_print(at.x, at.y, text.data(), nullptr, vertices.data(),
                                          static_cast<int>(vertices.size() * sizeof(Vertex)));
    for (int q = 0; q < quads; ++q) {
      const Vertex& first = vertices[static_cast<std::size_t>(4) * static_cast<std::size_t>(q)];
      const Vertex& third = vertices[static_cast<std::size_t>(4) * static_cast<std::size_t>(q) + 2];
      fill({first.x, first.y}, {third.x, third.y}, [](glm::vec3, float) { return glm::vec3(kInk); });
    }
  }
};

float widthOf(std::string text) { return static_cast<float>(stb_easy_font_width(text.data())); }

}  // namespace

std::optional<Legend> legendOf(Output output, const RenderSettings& settings, const ValueScale& scale) {
  if (output == Output::texture) return greyLegend("what textures add", -1 / settings.gain, 1 / settings.gain);
  if (!kNumberOutputs.has(output)) return std::nullopt;
  const double low = scale.low, high = scale.high;
  const double middle = scale.logarithmic ? std::sqrt(low * high) : (low + high) / 2;
  return Legend{titleOf(output),
                {number(low), number(middle), number(high)},
                [output, colors = settings.colors](float x) { return scaleColor(output, colors, x); }};
}

std::optional<Legend> legendOf(const Comparison& how) {
  if (how.mode == CompareMode::flip) {
    return Legend{"FLIP error", {"0", "0.5", "1"}, [](float x) { return colorOf(ColorMap::magma, x); }};
  }
  if (how.mode != CompareMode::difference) return std::nullopt;
  return how.with_sign ? greyLegend("difference, signed", -1 / how.gain, 1 / how.gain)
                       : greyLegend("difference", 0, 1 / how.gain);
}

Image withLegend(Image picture, const Legend& legend) {
  const int unit = std::max((picture.height + kUnitsHigh / 2) / kUnitsHigh, 1);
  const int wide = std::max(kBarWidth, static_cast<int>(widthOf(legend.title))) + 2 * kPadding;
  const int high = 2 * kPadding + 2 * kLine + kBar + kGap;
  // Large letters only where they fit.
  const int room = std::min(picture.width / (wide + 2 * kMargin), picture.height / (high + 2 * kMargin));
  if (room < 1) {
    throw Error(ErrorKind::usage, "--legend: the picture is too small (expected " + std::to_string(wide + 2 * kMargin) +
                                      "x" + std::to_string(high + 2 * kMargin) + " pixels or more, found " +
                                      std::to_string(picture.width) + "x" + std::to_string(picture.height) +
                                      "; --size makes it larger)");
  }
  const int used = std::min(unit, room);
  const Canvas canvas{picture, used, {kMargin * used, picture.height - (kMargin + high) * used}};
  canvas.fill({0, 0}, {wide, high}, [](glm::vec3 old, float) { return (1 - kVeil) * old; });
  canvas.write({kPadding, kPadding}, legend.title);
  const float left = kPadding, right = left + kBarWidth, top = kPadding + kLine, bottom = top + kBar;
  canvas.fill({left - 1, top - 1}, {right + 1, bottom + 1}, [](glm::vec3, float) { return glm::vec3(kInk); });
  canvas.fill({left, top}, {right, bottom}, [&](glm::vec3, float x) { return legend.color(x); });
  const float below = bottom + kGap;
  canvas.write({left, below}, legend.numbers[0]);
  canvas.write({(left + right - widthOf(legend.numbers[1])) / 2, below}, legend.numbers[1]);
  canvas.write({right - widthOf(legend.numbers[2]), below}, legend.numbers[2]);
  return picture;
}

}  // namespace tg
