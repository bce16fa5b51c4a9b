// SPDX-License-Identifier: Apache-2.0
// Makes the shared renderer on OpenGL's device.
#include "render/gl/gl_renderer.h"

#include "render/gl/pass_device.h"

namespace tg {

PassTuning tuningFor(const GlDevice& device) { return {device.software, device.software, 4}; }

unsigned GlRenderer::texture() const { return image() ? static_cast<const GlImage*>(image())->name() : 0; }

std::unique_ptr<GlRenderer> makeGlRenderer(GlDevice& device) { return makeGlRenderer(device, tuningFor(device)); }

std::unique_ptr<GlRenderer> makeGlRenderer(GlDevice& device, const PassTuning& tuning) {
  return std::make_unique<GlRenderer>(std::make_unique<GlPassDevice>(device), tuning);
}

}  // namespace tg
