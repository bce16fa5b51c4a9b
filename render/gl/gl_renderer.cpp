// SPDX-License-Identifier: Apache-2.0
// Makes the shared renderer on OpenGL's device.
#include "render/gl/gl_renderer.h"

#include "render/gl/pass_device.h"

namespace tg {

PassTuning tuningFor(const GlDevice& device) { return {device.software, device.software, device.software ? 4u : 1u}; }

unsigned GlRenderer::texture() const { return image() ? static_cast<const GlImage*>(image())->name() : 0; }

std::shared_ptr<GlPrograms> makeGlPrograms(const GlDevice& device) { return std::make_shared<GlPrograms>(device); }

std::unique_ptr<GlRenderer> makeGlRenderer(GlDevice& device) { return makeGlRenderer(device, makeGlPrograms(device)); }

std::unique_ptr<GlRenderer> makeGlRenderer(GlDevice& device, const PassTuning& tuning) {
  return std::make_unique<GlRenderer>(std::make_unique<GlPassDevice>(device, makeGlPrograms(device)), tuning);
}

std::unique_ptr<GlRenderer> makeGlRenderer(GlDevice& device, std::shared_ptr<GlPrograms> programs) {
  return std::make_unique<GlRenderer>(std::make_unique<GlPassDevice>(device, std::move(programs)), tuningFor(device));
}

}  // namespace tg
