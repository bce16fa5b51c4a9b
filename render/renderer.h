// SPDX-License-Identifier: Apache-2.0
// Model + camera -> images: what every backend offers.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/model/camera.h"
#include "core/model/model.h"
#include "render/settings.h"

namespace tg {

// Everything one pass over the splats yields, row-major, top row first, one entry per pixel. A member holds pixels when
// its output was asked for and is empty otherwise, unless the backend had it anyway. With w_i = T_i alpha_i of the
// blended splats, front to back, and T the transmittance that is left:
template <typename T>
struct FrameT {
  using Color = glm::vec<3, T>;
  int width = 0;
  int height = 0;
  std::vector<Color> picture;     // final, in frames without base and texture
  std::vector<Color> base;        // sum w_i c_base_i + T background
  std::vector<Color> texture;     // sum w_i c_texture_i (0 where no texture applies)
  std::vector<T> alpha;           // 1 - T
  std::vector<T> depth;           // sum w_i t_i / sum w_i: expected camera z of the hit; 0 where nothing is hit
  std::vector<Color> normal;      // sum w_i n_i, camera space, n_i = shortest axis turned to the camera
  std::vector<T> count;           // number of blended splats
  std::vector<T> depth_median;    // camera z of the hit that takes T below 1/2; 0 where none does
  std::vector<T> overdraw;        // number of hits with alpha >= kAlphaMin, those behind the last blended one included
  std::vector<Color> ellipsoids;  // the Gaussians as solid, lit surfaces at one sigma, nearest first, or background
  std::vector<Color> centers;     // a dot of 1.5 px radius in the base colour at every mean, nearest first
  // sum w_i d_i / sum w_i over the textured splats, d_i texels per pixel length at the mean (docs/math.md 3.1); 0 where
  // none is blended
  std::vector<T> texel_density;
  // base + texture, exactly, before any clamp.
  Color color(std::size_t pixel) const { return base.empty() ? picture[pixel] : base[pixel] + texture[pixel]; }

  FrameT() = default;
  // Zeros. Base and texture come together; so does final with them, and alone it is `picture`.
  FrameT(int w, int h, OutputSet outputs = kBlendedOutputs) : width(w), height(h) {
    const std::size_t n = static_cast<std::size_t>(w) * static_cast<std::size_t>(h);
    const OutputSet sums = {Output::base, Output::texture};
    const bool split = outputs.hasAny(sums);
    forEachPlane(
        [&](Output output, auto& pixels) {
          const bool wanted = sums.has(output) ? split : outputs.has(output) && !(split && output == Output::final);
          pixels.resize(wanted ? n : 0);
        },
        *this);
  }
};
using Frame = FrameT<float>;

// visit(output, pixels...) for each output, the pixels being those of all frames; final's are `picture`.
template <typename Visit, typename... Frames>
constexpr void forEachPlane(const Visit& visit, Frames&... frames) {
  visit(Output::final, frames.picture...);
  visit(Output::base, frames.base...);
  visit(Output::texture, frames.texture...);
  visit(Output::alpha, frames.alpha...);
  visit(Output::depth, frames.depth...);
  visit(Output::normal, frames.normal...);
  visit(Output::count, frames.count...);
  visit(Output::depthMedian, frames.depth_median...);
  visit(Output::overdraw, frames.overdraw...);
  visit(Output::ellipsoids, frames.ellipsoids...);
  visit(Output::centers, frames.centers...);
  visit(Output::texelDensity, frames.texel_density...);
}

// One output as numbers: 3 channels for colours and normals, else 1. Not clamped. Throws Error(usage) when the frame
// does not hold it.
Image extract(const Frame& frame, Output output);
// What the ends of a picture's colours stand for.
struct ValueScale {
  float low = 0, high = 0;
  bool logarithmic = false;     // between them
  bool near_is_bright = false;  // the low end has the last colour
  bool operator==(const ValueScale&) const = default;
};
// Of an output of kNumberOutputs over its own range: `least` and `most` of the numbers above 0, 0 where there are none.
ValueScale ownScale(Output output, float least, float most);
// The colour of a place on the scale, 0 at its low end.
glm::vec3 scaleColor(Output output, Colors colors, float place);
// Whether the picture is mapped by visualize() alone: no device has the formulas.
bool mapsOnHost(Output output, const RenderSettings& settings);

// One output as a picture in [0,1], 3 channels: texture as 0.5 + gain value / 2, normal as 0.5 + n / 2 with x right, y
// up and z to the viewer, depths as near = bright over their range, count and overdraw as a heat map with white =
// highest, texel density as a heat map of its logarithm from 1/64 (black) to 4 (white) texels a pixel, unless colours
// and range of the settings are others; final and base times 2^exposure before they are clamped. `scale` receives that
// of an output of kNumberOutputs. Throws as extract does.
Image visualize(const Frame& frame, Output output, const RenderSettings& settings = {}, ValueScale* scale = nullptr);

struct PassTime {
  std::string name;
  double milliseconds = 0;
};

// A backend with its copy of a model.
class Renderer {
 public:
  virtual ~Renderer() = default;
  // Keeps what it needs; the argument may go away.
  virtual void setModel(const GaussianModel& model) = 0;
  // The same; a backend that lives in the host's memory shares it instead of copying.
  virtual void setModel(std::shared_ptr<const GaussianModel> model) { setModel(*model); }
  // settings.outputs at least. Throws Error(device) when the device fails, Error(usage) before setModel, for an empty
  // camera, for settings that checkSettings() refuses, and for those that this backend cannot do, with their name.
  virtual Frame render(const Camera& camera, const RenderSettings& settings) = 0;
  // Of the last frame, in order of execution.
  virtual std::vector<PassTime> passTimes() const = 0;
  virtual std::string deviceName() const = 0;
};

std::unique_ptr<Renderer> makeCpuRenderer();  // render/cpu
// The deviceName() of everything that computes on the CPU: "CPU, AVX2, 2 threads".
std::string cpuName();

}  // namespace tg
