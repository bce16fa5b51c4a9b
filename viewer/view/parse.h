// SPDX-License-Identifier: Apache-2.0
// Values as text, of flags and of script commands.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "core/model/camera.h"
#include "render/renderer.h"
#include "viewer/view/camera_controller.h"
#include "viewer/view/compare.h"

namespace tg {

constexpr std::int64_t kMaxFramePixels = std::int64_t{1} << 26;  // all outputs of a frame: 3 GiB

// Each throws Error(usage) that names `what`, the offending text and the form expected.
glm::ivec2 parseSize(const std::string& text, const std::string& what);       // WxH
glm::vec3 parseColor(const std::string& text, const std::string& what);       // r,g,b in [0,1], white, black
TextureMode parseTextures(const std::string& text, const std::string& what);  // off, alpha, rgb, rgba
IntersectionModel parseIntersection(const std::string& text, const std::string& what);
Output parseShow(const std::string& text, const std::string& what);
SplatOrder parseOrder(const std::string& text, const std::string& what);  // global, per-pixel
TextureFilter parseFilter(const std::string& text, const std::string& what);
Antialiasing parseAntialias(const std::string& text, const std::string& what);
CropBox parseCrop(const std::string& text, const std::string& what);      // x0,y0,z0,x1,y1,z1; either corner first
float parseScale(const std::string& text, const std::string& what);       // 0 to kMaxScale
float parseExposure(const std::string& text, const std::string& what);    // [stops]
float parseNear(const std::string& text, const std::string& what);        // [world units]
float parseSplatScale(const std::string& text, const std::string& what);  // 0.01 to kMaxScale
glm::ivec2 parsePixel(const std::string& text, const std::string& what);  // x,y
std::string outputNames();                                          // for messages: final, base, ... or texel-density
int parseDegree(const std::string& text, const std::string& what);  // 0 to 3
double parseNumber(const std::string& text, const std::string& what);  // finite
double parseNumber(const std::string& text, double low, double high, const std::string& what);
CompareMode parseCompare(const std::string& text, const std::string& what);
UpAxis parseUp(const std::string& text, const std::string& what);    // cameras, +x, -x, ...
std::string texturesName(TextureMode mode);                          // as --textures has it
bool isImageSize(int width, int height);                             // of kMaxImageSide and kMaxFramePixels
std::string imageSizeLimits();                                       // for messages: what isImageSize() allows
bool parseSwitch(const std::string& text, const std::string& what);  // on, off
// A whole number below `count`.
std::size_t parseIndex(const std::string& text, std::size_t count, const std::string& what);

// N, counted from 0, of the model's cameras, or the first camera of a cameras.json. Throws Error(usage) for a number
// out of range, and what readCameras throws.
Camera cameraOf(const std::string& text, const std::vector<Camera>& model_cameras, const std::string& what);

}  // namespace tg
