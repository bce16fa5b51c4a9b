// SPDX-License-Identifier: Apache-2.0
// Model + camera -> images: what every backend offers.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "core/model.h"

namespace tg {

// Values equal kOutput* of shaders/shared/limits.h.
enum class Output : unsigned { final = 0, base = 1, texture = 2, alpha = 3, depth = 4, normal = 5, count = 6 };
std::string_view name(Output output);
std::optional<Output> parseOutput(std::string_view text);

struct RenderSettings {
  TextureMode textures = TextureMode::rgba;         // switches terms off; what counts is model mode AND this
  std::optional<IntersectionModel> intersection;    // default: the model's
  glm::vec3 background{0.0f};
  bool operator==(const RenderSettings&) const = default;
};

// Everything one pass over the splats yields, row-major, top row first, one entry per pixel. With w_i = T_i alpha_i of
// the blended splats, front to back, and T the transmittance that is left:
template <typename T>
struct FrameT {
  int width = 0;
  int height = 0;
  std::vector<glm::vec<3, T>> base;     // sum w_i c_base_i + T background
  std::vector<glm::vec<3, T>> texture;  // sum w_i c_texture_i (0 where no texture applies)
  std::vector<T> alpha;                 // 1 - T
  std::vector<T> depth;                 // sum w_i t_i / sum w_i: expected camera z of the hit; 0 where nothing is hit
  std::vector<glm::vec<3, T>> normal;   // sum w_i n_i, camera space, n_i = shortest axis turned to the camera
  std::vector<T> count;                 // number of blended splats
  // The picture: base + texture, exactly, before any clamp.
  glm::vec<3, T> color(std::size_t pixel) const { return base[pixel] + texture[pixel]; }

  FrameT() = default;
  FrameT(int w, int h)
      : width(w), height(h), base(n()), texture(n()), alpha(n()), depth(n()), normal(n()), count(n()) {}

 private:
  std::size_t n() const { return static_cast<std::size_t>(width) * height; }
};
using Frame = FrameT<float>;

// One output as numbers: final / base / texture / normal 3 channels, alpha / depth / count 1 channel. Not clamped.
Image extract(const Frame& frame, Output output);
// One output as a picture in [0,1], 3 channels: texture as 0.5 + value / 2, normal as 0.5 + n / 2 with x right, y up and
// z to the viewer, depth as near = bright over its range, count as a heat map with white = highest.
Image visualize(const Frame& frame, Output output);

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
  // All outputs. Throws Error(device) when the device fails, Error(usage) before setModel or for an empty camera.
  virtual Frame render(const Camera& camera, const RenderSettings& settings) = 0;
  // Of the last frame, in order of execution.
  virtual std::vector<PassTime> passTimes() const = 0;
  virtual std::string deviceName() const = 0;
};

std::unique_ptr<Renderer> makeCpuRenderer();  // render/cpu

}  // namespace tg
