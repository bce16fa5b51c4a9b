// SPDX-License-Identifier: Apache-2.0
// Values as text, of flags and of script commands.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "core/model/camera.h"
#include "core/system/numbers.h"

namespace tg {

constexpr std::int64_t kMaxFramePixels = std::int64_t{1} << 26;  // all outputs of a frame: 3 GiB

// Each throws Error(usage) that names `what`, the offending text and the form expected.
glm::ivec2 parseSize(const std::string& text, const std::string& what);   // WxH
glm::ivec2 parsePixel(const std::string& text, const std::string& what);  // x,y
bool isImageSize(int width, int height);                                  // of kMaxImageSide and kMaxFramePixels
std::string imageSizeLimits();                                            // for messages: what isImageSize() allows
bool parseSwitch(const std::string& text, const std::string& what);       // on, off
std::int64_t parseCount(const std::string& text, std::int64_t low, std::int64_t high, const std::string& what);
// A whole number below `count`.
std::size_t parseIndex(const std::string& text, std::size_t count, const std::string& what);

// N, counted from 0, of the model's cameras, or the first camera of a cameras.json. Throws Error(usage) for a number
// out of range, and what readCameras throws.
Camera cameraOf(const std::string& text, const std::vector<Camera>& model_cameras, const std::string& what);

}  // namespace tg
