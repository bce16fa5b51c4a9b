// SPDX-License-Identifier: Apache-2.0
// Contexts without a window.
#include <epoxy/egl.h>
#include <epoxy/gl.h>

#include <algorithm>

#include "core/system/error.h"
#include "render/gl/gl_device.h"

namespace tg {
namespace {

struct Source {
  std::string name;
  EGLDisplay display;
};

// Without a surface, the devices, the default display. Displays stay open until the process ends: EGL hands out one
// for each source, whoever asks.
std::vector<Source> sources() {
  std::vector<Source> found;
  if (!epoxy_has_egl()) return found;
  const bool platforms = epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_platform_base");
  if (platforms && epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_MESA_platform_surfaceless")) {
    found.push_back({"EGL without a surface",
                     eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr)});
  }
  const bool devices = epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_device_base") ||
                       epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_device_enumeration");
  if (platforms && devices && epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_EXT_platform_device")) {
    EGLint count = 0;
    std::vector<EGLDeviceEXT> all;
    if (eglQueryDevicesEXT(0, nullptr, &count)) {
      all.resize(static_cast<std::size_t>(count));
      eglQueryDevicesEXT(count, all.data(), &count);
      all.resize(static_cast<std::size_t>(count));
    }
    for (std::size_t i = 0; i < all.size(); ++i) {
      found.push_back(
          {"EGL device " + std::to_string(i), eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, all[i], nullptr)});
    }
  }
  found.push_back({"EGL's default display", eglGetDisplay(EGL_DEFAULT_DISPLAY)});
  return found;
}

struct EglDevice final : GlDevice {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;
  EGLSurface surface = EGL_NO_SURFACE;

  ~EglDevice() override {
    if (context == EGL_NO_CONTEXT) return;
    if (eglGetCurrentContext() == context) {
      eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    }
    eglDestroyContext(display, context);
    if (surface != EGL_NO_SURFACE) eglDestroySurface(display, surface);
  }
};

EGLContext createContext(EGLDisplay display, EGLConfig config, bool debug, bool notify) {
  std::vector<EGLint> attributes = {EGL_CONTEXT_MAJOR_VERSION_KHR,       4,
                                    EGL_CONTEXT_MINOR_VERSION_KHR,       5,
                                    EGL_CONTEXT_OPENGL_PROFILE_MASK_KHR, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT_KHR};
  if (debug) attributes.insert(attributes.end(), {EGL_CONTEXT_FLAGS_KHR, EGL_CONTEXT_OPENGL_DEBUG_BIT_KHR});
  if (notify) {
    attributes.insert(attributes.end(),
                      {EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY_KHR, EGL_LOSE_CONTEXT_ON_RESET_KHR});
  }
  attributes.push_back(EGL_NONE);
  return eglCreateContext(display, config, EGL_NO_CONTEXT, attributes.data());
}

// Makes a context current that can run the passes; otherwise returns why there is none.
std::string openContext(const Source& source, const GlOptions& options, EglDevice& device) {
  const EGLDisplay display = device.display = source.display;
  if (display == EGL_NO_DISPLAY) return "a display";
  if (!eglInitialize(display, nullptr, nullptr)) return "a display that opens";
  if (!eglBindAPI(EGL_OPENGL_API)) return "desktop OpenGL";
  if (epoxy_egl_version(display) < 15 && !epoxy_has_egl_extension(display, "EGL_KHR_create_context")) {
    return "EGL_KHR_create_context";
  }
  const bool surfaceless = epoxy_has_egl_extension(display, "EGL_KHR_surfaceless_context");
  EGLConfig config = nullptr;  // EGL_NO_CONFIG_KHR
  if (!surfaceless || !epoxy_has_egl_extension(display, "EGL_KHR_no_config_context")) {
    const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, surfaceless ? 0 : EGL_PBUFFER_BIT,
                             EGL_NONE};
    EGLint count = 0;
    if (!eglChooseConfig(display, wanted, &config, 1, &count) || count == 0) return "a configuration for OpenGL";
  }
  device.context = createContext(display, config, options.debug, true);
  if (device.context == EGL_NO_CONTEXT) device.context = createContext(display, config, options.debug, false);
  if (device.context == EGL_NO_CONTEXT) return "an OpenGL 4.5 core context";
  if (!surfaceless) {
    const EGLint size[] = {EGL_WIDTH, 1, EGL_HEIGHT, 1, EGL_NONE};
    device.surface = eglCreatePbufferSurface(display, config, size);
  }
  if (!eglMakeCurrent(display, device.surface, device.surface, device.context)) return "a context to make current";
  return whatIsMissing();
}

struct Found {
  std::unique_ptr<EglDevice> device;  // not current
  Source source;
  std::string version;
  std::string missing;  // "": it can be used
};

// Makes current again what was, unless told otherwise.
class CurrentContext {
 public:
  CurrentContext() {
    if (!epoxy_has_egl()) return;
    display_ = eglGetCurrentDisplay();
    context_ = eglGetCurrentContext();
    draw_ = eglGetCurrentSurface(EGL_DRAW);
    read_ = eglGetCurrentSurface(EGL_READ);
  }
  CurrentContext& operator=(CurrentContext&&) = delete;
  ~CurrentContext() {
    if (context_ != EGL_NO_CONTEXT) eglMakeCurrent(display_, draw_, read_, context_);
  }
  void forget() { context_ = EGL_NO_CONTEXT; }

 private:
  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
  EGLSurface draw_ = EGL_NO_SURFACE, read_ = EGL_NO_SURFACE;
};

// All there are, usable or not, each name and version once; sources without a device only where there is no device.
std::vector<Found> findDevices(const GlOptions& options) {
  std::vector<Found> found;
  for (const Source& source : sources()) {
    Found one{std::make_unique<EglDevice>(), source, {}, {}};
    one.missing = openContext(source, options, *one.device);
    const bool current = one.device->context != EGL_NO_CONTEXT && eglGetCurrentContext() == one.device->context;
    if (current) {
      GlOptions quiet = options;
      quiet.debug = false;  // the one chosen listens
      describeContext(*one.device, quiet);
      one.version = reinterpret_cast<const char*>(glGetString(GL_VERSION));
      eglMakeCurrent(source.display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    }
    const bool known = std::any_of(found.begin(), found.end(), [&](const Found& other) {
      return current && other.version == one.version && other.device->limits.device == one.device->limits.device;
    });
    if (!known) found.push_back(std::move(one));
  }
  const auto named = [](const Found& one) { return !one.device->limits.device.empty(); };
  if (std::any_of(found.begin(), found.end(), named)) std::erase_if(found, std::not_fn(named));
  return found;
}

}  // namespace

std::unique_ptr<GlDevice> createGlDevice(const GlOptions& options) {
  CurrentContext before;
  std::vector<Found> found = findDevices(options);
  std::string refused;
  Found* best = nullptr;
  for (std::size_t i = 0; i < found.size(); ++i) {
    Found& one = found[i];
    const std::string& name = one.device->limits.device;
    const std::string called = name.empty() ? one.source.name : "\"" + name + "\"";
    if (options.index ? i != *options.index : name.find(options.device) == std::string::npos) {
      refused += "; " + called + " has another " + (options.index ? "number" : "name");
    } else if (!one.missing.empty()) {
      refused += "; " + called + " lacks " + one.missing;
    } else if (!best || (best->device->software && !one.device->software)) {
      best = &one;
    }
  }
  if (!best) {
    const std::string wanted = options.device.empty() ? "" : " named \"" + options.device + "\"";
    throw Error(ErrorKind::device,
                "OpenGL: no usable device" + wanted + (found.empty() ? "; there is no libEGL" : refused));
  }
  std::unique_ptr<EglDevice> device = std::move(best->device);
  if (!eglMakeCurrent(device->display, device->surface, device->surface, device->context)) {
    throw Error(ErrorKind::device, device->limits.device, "OpenGL: the context cannot be made current");
  }
  before.forget();
  describeContext(*device, options);
  return device;
}

std::vector<DeviceInfo> listGlDevices() {
  const CurrentContext before;
  std::vector<DeviceInfo> infos;
  for (const Found& one : findDevices({})) {
    const std::string& name = one.device->limits.device;
    infos.push_back({"OpenGL", one.version, one.device->software, one.device->limits, one.missing});
    if (name.empty()) infos.back().limits.device = one.source.name;
  }
  return infos;
}

}  // namespace tg
