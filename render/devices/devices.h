// SPDX-License-Identifier: Apache-2.0
// Devices of every API that is built in, without a window.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/system/names.h"
#include "render/gpu/gpu_renderer.h"

namespace tg {

enum class Api { vulkan, opengl };
constexpr Api kApis[] = {Api::vulkan, Api::opengl};
constexpr auto namesOf(Api) { return enumNames("vulkan", "opengl"); }  // as --backend has it

// What --device names.
struct DevicePick {
  std::optional<Api> api;            // of the number; none for a name
  std::string name;                  // part of a device's name; "": the fastest kind there is
  std::optional<std::size_t> index;  // among the API's devices
  bool any() const { return !index && name.empty(); }
};
// A number in listDevices(), or part of a name. Throws Error(usage) for a number beyond the list.
DevicePick pickDevice(const std::string& device);

struct OpenOptions {
  DevicePick pick;
  bool validation = false;  // Vulkan's validation layers, OpenGL's debug messages
};

class OpenDevice {
 public:
  virtual ~OpenDevice() = default;
  virtual bool software() const = 0;
  // Must not outlive this, nor leave the thread.
  virtual std::unique_ptr<GpuRenderer> makeRenderer() = 0;
  // What validation found so far.
  virtual std::vector<std::string> messages() const = 0;
};

// Throws Error(device) that says why: not built in, no driver, what each device lacks.
std::unique_ptr<OpenDevice> openDevice(Api api, const OpenOptions& options);

// Usable or not, those of Vulkan first. A driver that fails is an entry that says so.
std::vector<DeviceInfo> listDevices();
std::vector<DeviceInfo> listDevices(Api api);

}  // namespace tg
