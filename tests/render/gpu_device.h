// SPDX-License-Identifier: Apache-2.0
// The API under test: each program that runs these tests has one, in vulkan_device.cpp or opengl_device.cpp. One
// validated device for the whole program: drivers that compile shaders on the CPU take seconds to warm up.
#pragma once
#include <array>
#include <functional>
#include <vector>

#include "render/devices/devices.h"

namespace tg::test {

Api testedApi();
// One renderer on the device, with its pipelines.
GpuRenderer& gpuRenderer();
std::unique_ptr<GpuRenderer> makeGpuRenderer(const PassTuning& tuning);
// Two renderers that share what the shaders are compiled to, and nothing else has it.
std::array<std::unique_ptr<GpuRenderer>, 2> makeSharingRenderers();
std::unique_ptr<GpuDevice> makePassDevice();
// What lives on the device from case to case registers here how it ends: with the run, and not with the program, when a
// layer's or a driver's own statics may be gone; the last to register ends first.
inline std::vector<std::function<void()>>& endings() {
  static std::vector<std::function<void()>> all;
  return all;
}

// The messages since the last call, one a line: CHECK(validationMessages() == "").
std::string validationMessages();

// What the device claims to bind at most.
struct Bindings {
  std::uint32_t bytes;   // of a storage buffer
  std::uint32_t texels;  // of a buffer
};
// Returns what it claimed before.
Bindings claim(Bindings bindings);

}  // namespace tg::test
