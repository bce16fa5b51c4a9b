// SPDX-License-Identifier: Apache-2.0
// Pictures of a model.
#pragma once
#include <array>
#include <memory>
#include <optional>
#include <string>

#include "textured_gaussians/camera.h"
#include "textured_gaussians/image.h"
#include "textured_gaussians/model.h"

namespace textured_gaussians {

// What is drawn, as numbers that are not clamped. Depths are camera z [world units], 0 where nothing is hit.
enum class Output {
  final,        // 3 channels: base + texture
  base,         // 3: without what textures add
  texture,      // 3: what textures add
  alpha,        // 1: coverage, 0 to 1
  depth,        // 1: the expected one
  normal,       // 3: the Gaussians' shortest axes, camera space, weighted as colours are
  count,        // 1: Gaussians that were blended
  depthMedian,  // 1: of the hit with which half of the light is gone
};

struct RenderOptions {
  TextureMode textures = TextureMode::rgba;             // terms that count, of those that the model has
  std::optional<std::array<float, 3>> background = {};  // RGB; without one: the model's
  float splat_scale = 1;                                // above 0: on every sigma
  float opacity_scale = 1;                              // 0 or above: on every opacity
  int max_sh_degree = 3;                                // 0 to 3: higher bands are left out
};

// Draws on the processor, with all threads. The same bytes for any number of them. Calls from several threads wait for
// one another. One that was moved from may only be assigned to.
class Renderer {
 public:
  explicit Renderer(const Model& model);
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  // [camera.height, camera.width, channels of the output]. Throws Error(usage) for a camera, an output or options that
  // are none.
  Image render(const Camera& camera, Output output = Output::final, const RenderOptions& options = {});

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// Threads of rendering, training and conversion from now on; 0, as at the start: as many as the machine has. What runs
// on another thread meanwhile takes them up as it goes on. Throws Error(usage) below 0 or above 1024.
void setThreads(int count);

}  // namespace textured_gaussians
