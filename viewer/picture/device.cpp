// SPDX-License-Identifier: Apache-2.0
// Which API a window draws with.
#include "viewer/picture/device.h"

#include <string>

#include "core/system/error.h"

namespace tg {
namespace {

const char* title(Api api) { return api == Api::vulkan ? "Vulkan" : "OpenGL"; }

}  // namespace

std::vector<Api> apisFor(const ViewOptions& options, const DevicePick& pick) {
  if (options.backend == Backend::cpu) return {};
  if (options.backend == Backend::automatic) return pick.api ? std::vector{*pick.api} : std::vector(kApis, kApis + 2);
  const Api api = options.backend == Backend::vulkan ? Api::vulkan : Api::opengl;
  if (pick.api && *pick.api != api) {
    throw Error(ErrorKind::usage, "--device " + options.device + " is one of " + title(*pick.api) +
                                      " (expected one of " + title(api) + " with --backend " + std::string(name(api)) +
                                      ")");
  }
  return {api};
}

}  // namespace tg
