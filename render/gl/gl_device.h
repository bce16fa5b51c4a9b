// SPDX-License-Identifier: Apache-2.0
// An OpenGL 4.5 core context with what it can do: headless through EGL, or a window's.
#pragma once
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "render/gpu/device.h"

namespace tg {

struct GlOptions {
  bool debug = false;                // a debug context whose messages are kept
  std::string device;                // part of a device's name; empty: any, hardware first
  std::optional<std::size_t> index;  // of listGlDevices(); instead of a name
  bool text = false;                 // passes come as GLSL text even where the driver loads SPIR-V
};

// A context is current in one thread at a time: whoever uses a device or what lies on it does so in the thread that
// made it.
struct GlDevice {
  virtual ~GlDevice() = default;

  GpuLimits limits;
  bool software = false;                    // it runs on the CPU
  bool spirv = false;                       // it loads SPIR-V modules
  bool time_stamps = false;                 // that can be believed
  bool reset_status = false;                // it tells when the context is lost
  std::uint32_t uniform_alignment = 256;    // [bytes] of an offset into a uniform buffer
  bool debug = false;                       // asked for and there
  std::vector<std::string> debug_messages;  // every error and warning, in order; tests demand none
  mutable std::mutex messages_mutex;        // guards debug_messages where another thread looks at them
};

// Headless. Tries EGL without a surface, then EGL's devices, then its default display. Throws Error(device) that says
// what each of them lacks.
std::unique_ptr<GlDevice> createGlDevice(const GlOptions& options);
// For the context that is current, a window's. Throws Error(device) when it cannot run the passes.
std::unique_ptr<GlDevice> wrapGlContext(const GlOptions& options);

// Those that createGlDevice() chooses from, each once.
std::vector<DeviceInfo> listGlDevices();

// For the makers of contexts: why the current one cannot run the passes, or empty.
std::string whatIsMissing();
// Fills in all of `device` from the current context, and listens to its messages when options.debug.
void describeContext(GlDevice& device, const GlOptions& options);

// Throws Error(device) for the first error that OpenGL has noted, or when the context is lost; `what` was being done.
void checkGl(const GlDevice& device, const char* what);

}  // namespace tg
