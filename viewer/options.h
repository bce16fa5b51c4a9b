// SPDX-License-Identifier: Apache-2.0
// What the command line and scripts share: values as text, and models as scenes.
#pragma once
#include <filesystem>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "converter/read_model.h"
#include "viewer/state.h"

namespace tg {

constexpr std::int64_t kMaxFramePixels = std::int64_t{1} << 26;  // all outputs of a frame: 3 GiB

constexpr double kMinFps = 0.1, kMaxFps = 1000;  // of recordings [1 / s]

// automatic: Vulkan on a GPU, else OpenGL on a GPU, else the CPU renderer: where these run on the CPU themselves, they
// are slower.
enum class Backend { automatic, vulkan, opengl, cpu };

// What the command line asks for, in a window or to a file.
struct ViewOptions {
  std::filesystem::path model;
  std::vector<std::filesystem::path> more_models;  // to open beside it in a window
  std::filesystem::path compare;                   // another model, to compare with
  std::filesystem::path photographs;               // a folder of the data set's, to compare with
  CompareMode compare_mode = CompareMode::side;
  std::filesystem::path out;     // .png, .jpg: a picture; .exr: the numbers. Empty: a window
  std::filesystem::path script;  // drives the window; may be empty
  bool follow = false;           // the model is a file or a run folder that changes
  std::string camera;            // "": the model's first test camera, else the whole model in view
  Output show = Output::final;
  TextureMode textures = TextureMode::rgba;
  std::optional<IntersectionModel> intersection;  // default: the model's
  RenderSettings settings;                        // order, filters, scales, degree, near plane, crop box
  float exposure = 0;                             // [stops]
  std::optional<glm::ivec2> size;                 // default: the camera's
  std::optional<glm::vec3> background;            // default: the model's
  Backend backend = Backend::automatic;
  std::string device;  // a number of --list-devices, or part of a device's name
  bool validation = false;
  std::optional<int> frames_in_flight;              // 1 or 2; default: 2 where a Vulkan device has two queues
  bool timings = false;                             // say how long it took from the start to the first pictures
  std::filesystem::path session;                    // keeps the window's state between runs; empty: nothing is kept
  bool show_given = false, textures_given = false;  // else the session's, where there is one
  UpAxis up = UpAxis::cameras;

  std::filesystem::path record;     // --output: a video, pictures; empty: none
  std::filesystem::path path;       // a camera path; may be empty
  int turntable = 0;                // frames of a turn; 0: none
  std::optional<double> elevation;  // [rad] of the turntable above the horizon, looking at the model's centre
  std::optional<double> radius;     // [world units] of the turntable
  double fps = 30;
  std::optional<glm::ivec2> inspect;  // the pixel to list the splats of
  bool benchmark = false;             // time the path's frames
};

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
UpAxis parseUp(const std::string& text, const std::string& what);  // cameras, +x, -x, ...
std::string texturesName(TextureMode mode);                        // as --textures has it
bool isImageSize(int width, int height);                           // of kMaxImageSide and kMaxFramePixels

// N, counted from 0, of the model's cameras, or the first camera of a cameras.json. Throws Error(usage) for a number
// out of range, and what readCameras throws.
Camera cameraOf(const std::string& text, const std::vector<Camera>& model_cameras, const std::string& what);

// What --camera names, or the view that the window opens with; at --size.
Camera cameraFor(const ViewOptions& options, const Scene& scene);

// What frames are drawn with; `background` is the model's.
RenderSettings settingsFor(const ViewOptions& options, glm::vec3 background);

Scene describe(LoadedModel loaded, const std::filesystem::path& path);
Scene sceneFor(const ViewOptions& options, LoadedModel loaded);  // with --up

}  // namespace tg
