// SPDX-License-Identifier: Apache-2.0
// What a training step needs from a renderer: a picture, and the gradient of a loss on it. training/cpu implements it,
// and training/cuda; the trainer does not notice which.
#pragma once
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/model/camera.h"
#include "core/model/model.h"
#include "render/renderer.h"

namespace tg {

// dL/d(parameter) as stored in GaussianModel (of the raw quaternion), same shapes.
struct ModelGradient : ModelFields<Values> {  // of texels rgb is zero in mode alpha, a in mode rgb
  // Densification statistics of this view (docs/math.md 6.9), NDC units: x * width / 2, y * height / 2.
  std::vector<float> screen_gradient;      // [N] |sum over pixels of e_j|
  std::vector<float> screen_gradient_abs;  // [N] sum over pixels of |e_j|
  std::vector<float> screen_radius;        // [N] px, half the longer side of the screen box; 0 = not visible
};

struct GradientOptions {
  // Off: screen_gradient_abs stays zero. It costs a square root per pixel and splat, and only densification reads it.
  bool statistics = true;
  // Ablations of the exact gradients (docs/math.md 6). Off: no gradient flows from a texture's coordinates into the
  // geometry (6.3d); what lies behind a splat counts with its base colour alone (6.1c).
  bool texture_to_geometry = true;
  bool texture_in_suffix = true;
};

// Where a step's time went.
struct PhaseTime {
  const char* name;
  double wall;       // [ms]
  double processor;  // [ms] of all threads together
};

class TrainingEngine;  // training/step/engine.h

class DifferentiableRenderer {
 public:
  virtual ~DifferentiableRenderer() = default;
  // What is drawn from now on. It must stay where it is, unchanged, until the last forward() or backward() with it
  // returned; a renderer with memory of its own takes it there once.
  virtual void setModel(const GaussianModel& model) = 0;
  // The picture [height * width], not clamped, of the model that was set. `camera` must stay unchanged until backward()
  // returned.
  virtual const std::vector<glm::vec3>& forward(const Camera& camera, const RenderSettings& settings) = 0;
  const std::vector<glm::vec3>& forward(const GaussianModel& model, const Camera& camera,
                                        const RenderSettings& settings) {
    setModel(model);
    return forward(camera, settings);
  }
  // Gradient of a loss whose derivative with respect to the picture of the last forward() is v_color. Overwrites
  // `gradient` (resized as needed). Texel gradients pass only where the stored alpha texel lies in [0, 1].
  // Same bytes for any thread count. Throws Error(usage) where that picture is of TextureOutside::edge.
  virtual void backward(std::span<const glm::vec3> v_color, ModelGradient& gradient,
                        const GradientOptions& options = {}) = 0;
  // Of the last forward() and backward(), in order of execution.
  virtual std::span<const PhaseTime> phaseTimes() const = 0;
  // blendWeights() of the model (render/contribution.h), in pictures as they are drawn here. Before the next forward()
  // a model is set again.
  virtual std::vector<double> seenWeights(const GaussianModel& model, std::span<const Camera> views);
  // What it runs on, as training.json names it.
  virtual std::string deviceName() const = 0;
  // What a trainer steps with, by default on the host through forward() and backward(). The renderer must outlive it.
  virtual std::unique_ptr<TrainingEngine> makeTrainingEngine(float ssim_weight);
};

// Splats that reach over several tiles keep one copy of their texels' gradients per tile until they are added up; tiles
// wait when more than texels_in_flight are kept. 16 Mi texels are 256 MiB: a million 4 x 4 textures. Does not change
// the result.
std::unique_ptr<DifferentiableRenderer> makeCpuDifferentiableRenderer(std::size_t texels_in_flight = std::size_t{16}
                                                                                                     << 20);

}  // namespace tg
