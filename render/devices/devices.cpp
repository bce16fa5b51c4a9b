// SPDX-License-Identifier: Apache-2.0
// Lists and opens what each API brings.
#include "render/devices/devices.h"

#include <optional>

#include "core/system/error.h"
#include "core/system/numbers.h"
#ifdef TG_VULKAN
#include "render/vulkan/vulkan_renderer.h"
#endif
#ifdef TG_OPENGL
#include "render/gl/gl_renderer.h"
#endif

namespace tg {
namespace {

constexpr const char* title(Api api) { return api == Api::vulkan ? "Vulkan" : "OpenGL"; }

DeviceInfo unusable(Api api, const std::string& problem) {
  DeviceInfo info;
  info.api = title(api);
  info.missing = problem;
  return info;
}

#ifdef TG_VULKAN
class OpenVulkan final : public OpenDevice {
 public:
  explicit OpenVulkan(const VulkanOptions& options) : device_(createVulkanDevice(options)) {}
  bool software() const override { return device_->properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU; }
  std::unique_ptr<GpuRenderer> makeRenderer() override { return makeVulkanRenderer(*device_); }
  std::vector<std::string> messages() const override { return device_->validation_messages; }

 private:
  std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> device_;
};
#endif

#ifdef TG_OPENGL
class OpenGl final : public OpenDevice {
 public:
  explicit OpenGl(const GlOptions& options) : device_(createGlDevice(options)) {}
  bool software() const override { return device_->software; }
  std::unique_ptr<GpuRenderer> makeRenderer() override { return makeGlRenderer(*device_); }
  std::vector<std::string> messages() const override { return device_->debug_messages; }

 private:
  std::unique_ptr<GlDevice> device_;
};
#endif

}  // namespace

std::vector<DeviceInfo> listDevices(Api api) {
  try {
#ifdef TG_VULKAN
    if (api == Api::vulkan) return listVulkanDevices();
#endif
#ifdef TG_OPENGL
    if (api == Api::opengl) return listGlDevices();
#endif
  } catch (const Error& error) {
    return {unusable(api, error.what())};
  }
  return {unusable(api, "this program was built without it")};
}

std::vector<DeviceInfo> listDevices() {
  std::vector<DeviceInfo> all;
  for (const Api api : kApis) {
    for (DeviceInfo& info : listDevices(api)) all.push_back(std::move(info));
  }
  return all;
}

DevicePick pickDevice(const std::string& device) {
  const auto number = parseWhole<std::size_t>(device);
  if (!number) return {std::nullopt, device, std::nullopt};
  std::size_t first = 0;
  for (const Api api : kApis) {
    const std::size_t count = listDevices(api).size();
    if (*number < first + count) return {api, {}, *number - first};
    first += count;
  }
  throw Error(ErrorKind::usage, "--device: expected a name or 0 to " + std::to_string(first - 1) +
                                    " (see --list-devices), found \"" + device + "\"");
}

std::unique_ptr<OpenDevice> openDevice(Api api, [[maybe_unused]] const OpenOptions& options) {
#ifdef TG_VULKAN
  if (api == Api::vulkan) {
    VulkanOptions vulkan;
    vulkan.validation = options.validation;
    vulkan.device = options.pick.name;
    vulkan.index = options.pick.index;
    return std::make_unique<OpenVulkan>(vulkan);
  }
#endif
#ifdef TG_OPENGL
  if (api == Api::opengl) {
    GlOptions gl;
    gl.debug = options.validation;
    gl.device = options.pick.name;
    gl.index = options.pick.index;
    return std::make_unique<OpenGl>(gl);
  }
#endif
  throw Error(ErrorKind::device, std::string(title(api)) + ": this program was built without it");
}

}  // namespace tg
