// SPDX-License-Identifier: Apache-2.0
// The device of the tests that every GPU backend shares: OpenGL's.
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "gpu_device.h"
#include "render/gl/gl_renderer.h"
#include "render/gl/pass_device.h"

namespace tg::test {
namespace {

// With TG_TEST_GLSL in the environment the driver is given GLSL text instead of SPIR-V.
std::unique_ptr<GlDevice> createTestDevice() {
  GlOptions options;
  options.debug = true;
  options.text = std::getenv("TG_TEST_GLSL") != nullptr;
  auto device = createGlDevice(options);
  std::printf("device: %s; passes as %s%s\n", device->limits.device.c_str(), device->spirv ? "SPIR-V" : "GLSL",
              device->debug ? "" : "; NOT validated: no debug context");
  return device;
}

GlDevice& glDevice() {
  static const auto device = createTestDevice();
  return *device;
}

}  // namespace

Api testedApi() { return Api::opengl; }

GpuRenderer& gpuRenderer() {
  static const auto renderer = makeGlRenderer(glDevice());
  return *renderer;
}

std::unique_ptr<GpuRenderer> makeGpuRenderer(const PassTuning& tuning) { return makeGlRenderer(glDevice(), tuning); }

std::array<std::unique_ptr<GpuRenderer>, 2> makeSharingRenderers() {
  const auto programs = makeGlPrograms(glDevice());
  return {makeGlRenderer(glDevice(), programs), makeGlRenderer(glDevice(), programs)};
}

std::unique_ptr<GpuDevice> makePassDevice() {
  return std::make_unique<GlPassDevice>(glDevice(), makeGlPrograms(glDevice()));
}

std::string validationMessages() {
  std::string text;
  for (const std::string& message : glDevice().debug_messages) text += message + "\n";
  glDevice().debug_messages.clear();
  return text;
}

Bindings claim(Bindings bindings) {
  GpuLimits& limits = glDevice().limits;
  return {std::exchange(limits.storage_bytes, bindings.bytes), std::exchange(limits.texel_elements, bindings.texels)};
}

}  // namespace tg::test
