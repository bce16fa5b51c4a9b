// SPDX-License-Identifier: Apache-2.0
// Values as text, with errors that say what was expected.
#include "viewer/view/parse.h"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string_view>

#include "core/bundle/camera_file.h"
#include "core/system/error.h"
#include "viewer/view/state.h"

namespace tg {
namespace {

[[noreturn]] void refuse(const std::string& what, const std::string& text, const std::string& expected) {
  throw Error(ErrorKind::usage, what + ": expected " + expected + ", found \"" + text + "\"");
}

template <typename T>
std::optional<T> parseWhole(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

bool isImageSize(int width, int height) {
  return width >= 1 && height >= 1 && width <= kMaxImageSide && height <= kMaxImageSide &&
         std::int64_t{width} * height <= kMaxFramePixels;
}

std::string imageSizeLimits() {
  return "sides of 1 to " + std::to_string(kMaxImageSide) + ", at most " + std::to_string(kMaxFramePixels) + " pixels";
}

SplatOrder parseOrder(const std::string& text, const std::string& what) {
  const auto order = parseSplatOrder(text);
  if (!order) refuse(what, text, "global or per-pixel");
  return *order;
}

TextureFilter parseFilter(const std::string& text, const std::string& what) {
  const auto filter = parseTextureFilter(text);
  if (!filter) refuse(what, text, "bilinear or footprint");
  return *filter;
}

Antialiasing parseAntialias(const std::string& text, const std::string& what) {
  const auto mode = parseAntialiasing(text);
  if (!mode) refuse(what, text, "off or screen");
  return *mode;
}

CropBox parseCrop(const std::string& text, const std::string& what) {
  glm::vec3 corners[2];
  std::string_view rest = text;
  for (int i = 0; i < 6; ++i) {
    const std::size_t comma = i < 5 ? rest.find(',') : rest.size();
    const auto value = comma == std::string_view::npos ? std::nullopt : parseWhole<float>(rest.substr(0, comma));
    if (!value || !std::isfinite(*value)) refuse(what, text, "two corners of a box x0,y0,z0,x1,y1,z1");
    corners[i / 3][i % 3] = *value;
    if (i < 5) rest.remove_prefix(comma + 1);
  }
  return {glm::min(corners[0], corners[1]), glm::max(corners[0], corners[1])};
}

float parseScale(const std::string& text, const std::string& what) {
  return static_cast<float>(parseNumber(text, 0, kMaxScale, what));
}

float parseSplatScale(const std::string& text, const std::string& what) {
  return static_cast<float>(parseNumber(text, kMinSplatScale, kMaxScale, what));
}

float parseExposure(const std::string& text, const std::string& what) {
  return static_cast<float>(parseNumber(text, -kMaxExposure, kMaxExposure, what));
}

float parseNear(const std::string& text, const std::string& what) {
  return static_cast<float>(parseNumber(text, 1e-6, 1e6, what));
}

glm::ivec2 parsePixel(const std::string& text, const std::string& what) {
  const std::size_t comma = text.find(',');
  const auto x = parseWhole<int>(std::string_view(text).substr(0, comma));
  const auto y = comma == std::string::npos ? std::nullopt : parseWhole<int>(std::string_view(text).substr(comma + 1));
  if (!x || !y || *x < 0 || *y < 0 || *x >= kMaxImageSide || *y >= kMaxImageSide) refuse(what, text, "a pixel x,y");
  return {*x, *y};
}

int parseDegree(const std::string& text, const std::string& what) {
  const auto degree = parseWhole<int>(text);
  if (!degree || *degree < 0 || *degree > 3) refuse(what, text, "a degree from 0 to 3");
  return *degree;
}

glm::ivec2 parseSize(const std::string& text, const std::string& what) {
  const std::size_t x = text.find('x');
  const auto width = parseWhole<int>(std::string_view(text).substr(0, x));
  const auto height = x == std::string::npos ? std::nullopt : parseWhole<int>(std::string_view(text).substr(x + 1));
  if (!width || !height || !isImageSize(*width, *height)) refuse(what, text, "WIDTHxHEIGHT, " + imageSizeLimits());
  return {*width, *height};
}

glm::vec3 parseColor(const std::string& text, const std::string& what) {
  if (text == "white") return glm::vec3(1.0f);
  if (text == "black") return glm::vec3(0.0f);
  glm::vec3 color;
  std::string_view rest = text;
  for (int c = 0; c < 3; ++c) {
    const std::size_t comma = c < 2 ? rest.find(',') : rest.size();
    const auto value = comma == std::string_view::npos ? std::nullopt : parseWhole<float>(rest.substr(0, comma));
    if (!value || !(*value >= 0.0f && *value <= 1.0f)) refuse(what, text, "r,g,b in [0,1], white or black");
    color[c] = *value;
    if (c < 2) rest.remove_prefix(comma + 1);
  }
  return color;
}

TextureMode parseTextures(const std::string& text, const std::string& what) {
  if (text == "off") return TextureMode::none;
  const auto mode = parseTextureMode(text);
  if (!mode) refuse(what, text, "off, alpha, rgb or rgba");
  return *mode;
}

std::string texturesName(TextureMode mode) { return mode == TextureMode::none ? "off" : std::string(name(mode)); }

IntersectionModel parseIntersection(const std::string& text, const std::string& what) {
  const auto model = parseIntersectionModel(text);
  if (!model) refuse(what, text, "plane or maxResponse");
  return *model;
}

std::string outputNames() {
  std::string names;
  for (unsigned k = 0; k < kOutputKinds; ++k) {
    names += (k == 0 ? "" : k + 1 == kOutputKinds ? " or " : ", ") + std::string(name(static_cast<Output>(k)));
  }
  return names;
}

Output parseShow(const std::string& text, const std::string& what) {
  const auto output = parseOutput(text);
  if (!output) refuse(what, text, outputNames());
  return *output;
}

double parseNumber(const std::string& text, const std::string& what) {
  const auto value = parseWhole<double>(text);
  if (!value || !std::isfinite(*value)) refuse(what, text, "a number");
  return *value;
}

double parseNumber(const std::string& text, double low, double high, const std::string& what) {
  const auto value = parseWhole<double>(text);
  if (!value || !(*value >= low && *value <= high)) {
    char limits[80];
    std::snprintf(limits, sizeof limits, "a number from %g to %g", low, high);
    refuse(what, text, limits);
  }
  return *value;
}

bool parseSwitch(const std::string& text, const std::string& what) {
  if (text != "on" && text != "off") refuse(what, text, "on or off");
  return text == "on";
}

std::size_t parseIndex(const std::string& text, std::size_t count, const std::string& what) {
  const double index = parseNumber(text, what);
  if (!(index >= 0 && index < static_cast<double>(count) && index == std::floor(index)))
    refuse(what, text, "a number below " + std::to_string(count));
  return static_cast<std::size_t>(index);
}

CompareMode parseCompare(const std::string& text, const std::string& what) {
  const auto mode = parseCompareMode(text);
  if (!mode) refuse(what, text, "off, side, wipe, flicker or difference");
  return *mode;
}

UpAxis parseUp(const std::string& text, const std::string& what) {
  const auto axis = parseUpAxis(text);
  if (!axis) refuse(what, text, "cameras, +x, -x, +y, -y, +z or -z");
  return *axis;
}

Camera cameraOf(const std::string& text, const std::vector<Camera>& model_cameras, const std::string& what) {
  if (text.find_first_not_of("0123456789") == std::string::npos && !text.empty()) {
    const auto index = parseWhole<std::size_t>(text);
    if (model_cameras.empty()) refuse(what, text, "a cameras.json: the model has no cameras");
    if (!index || *index >= model_cameras.size()) {
      refuse(what, text, "0 to " + std::to_string(model_cameras.size() - 1) + " (see --list-cameras)");
    }
    return model_cameras[*index];
  }
  const std::vector<Camera> cameras = readCameras(text);
  if (cameras.empty()) throw Error(ErrorKind::badData, text, "no camera inside (expected at least 1, found 0)");
  return cameras.front();
}

}  // namespace tg
