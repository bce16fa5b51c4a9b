// SPDX-License-Identifier: Apache-2.0
// Values as text, with errors that say what was expected.
#include "viewer/view/parse.h"

#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include "core/bundle/camera_file.h"
#include "core/system/error.h"
#include "viewer/view/state.h"

namespace tg {
bool isImageSize(int width, int height) {
  return width >= 1 && height >= 1 && width <= kMaxImageSide && height <= kMaxImageSide &&
         std::int64_t{width} * height <= kMaxFramePixels;
}

std::string imageSizeLimits() {
  return "sides of 1 to " + std::to_string(kMaxImageSide) + ", at most " + std::to_string(kMaxFramePixels) + " pixels";
}

glm::ivec2 parsePixel(const std::string& text, const std::string& what) {
  std::array<int, 2> at{};
  const auto outside = [](int x) { return x < 0 || x >= kMaxImageSide; };
  if (!parseList<int>(text, at) || outside(at[0]) || outside(at[1])) refuseValue(what, text, "a pixel x,y");
  return {at[0], at[1]};
}

glm::ivec2 parseSize(const std::string& text, const std::string& what) {
  const std::size_t x = text.find('x');
  const auto width = parseWhole<int>(std::string_view(text).substr(0, x));
  const auto height = x == std::string::npos ? std::nullopt : parseWhole<int>(std::string_view(text).substr(x + 1));
  if (!width || !height || !isImageSize(*width, *height)) refuseValue(what, text, "WIDTHxHEIGHT, " + imageSizeLimits());
  return {*width, *height};
}

bool parseSwitch(const std::string& text, const std::string& what) {
  if (text != "on" && text != "off") refuseValue(what, text, "on or off");
  return text == "on";
}

std::int64_t parseCount(const std::string& text, std::int64_t low, std::int64_t high, const std::string& what) {
  const auto number = parseWhole<double>(text);  // 1e6 is one
  if (!number || !(*number >= static_cast<double>(low) && *number <= static_cast<double>(high)) ||
      *number != std::floor(*number)) {
    refuseValue(what, text, "a whole number from " + std::to_string(low) + " to " + std::to_string(high));
  }
  return static_cast<std::int64_t>(*number);
}

std::size_t parseIndex(const std::string& text, std::size_t count, const std::string& what) {
  const double index = parseNumber(text, what);
  if (!(index >= 0 && index < static_cast<double>(count) && index == std::floor(index))) {
    refuseValue(what, text,
                count == 0 ? "none: there is nothing to choose from" : "a number below " + std::to_string(count));
  }
  return static_cast<std::size_t>(index);
}

Camera cameraOf(const std::string& text, const std::vector<Camera>& model_cameras, const std::string& what) {
  if (text.find_first_not_of("-0123456789") == std::string::npos && !text.empty()) {
    const auto index = parseWhole<std::size_t>(text);
    if (model_cameras.empty()) refuseValue(what, text, "a cameras.json: the model has no cameras");
    if (!index || *index >= model_cameras.size()) {
      refuseValue(what, text, "0 to " + std::to_string(model_cameras.size() - 1) + " (see --list-cameras)");
    }
    return model_cameras[*index];
  }
  const std::vector<Camera> cameras = readCameras(text);
  if (cameras.empty()) throw Error(ErrorKind::badData, text, "no camera inside (expected at least 1, found 0)");
  return cameras.front();
}

}  // namespace tg
