// SPDX-License-Identifier: Apache-2.0
// The OpenGL backend: the shared renderer on compute shaders of OpenGL 4.5.
#pragma once
#include <memory>

#include "render/gl/gl_device.h"
#include "render/gpu/gpu_renderer.h"

namespace tg {

PassTuning tuningFor(const GlDevice& device);

class GlRenderer : public GpuRenderer {
 public:
  using GpuRenderer::GpuRenderer;
  // Name of the RGBA8 texture that draw() drew. Changes when the size changes.
  unsigned texture() const;
};

// What the passes' shaders are compiled to, kept for renderers of one context, which must be current where the last of
// them ends.
class GlPrograms;
std::shared_ptr<GlPrograms> makeGlPrograms(const GlDevice& device);

// `device` must outlive the renderer, and its context be current whenever the renderer is used or destroyed.
std::unique_ptr<GlRenderer> makeGlRenderer(GlDevice& device);
std::unique_ptr<GlRenderer> makeGlRenderer(GlDevice& device, const PassTuning& tuning);
// Compiles only what `programs` does not have yet.
std::unique_ptr<GlRenderer> makeGlRenderer(GlDevice& device, std::shared_ptr<GlPrograms> programs);

}  // namespace tg
