// SPDX-License-Identifier: Apache-2.0
// What a context can do, its errors and its messages.
#include "render/gl/gl_device.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <utility>

#include "core/system/error.h"

namespace tg {
namespace {

constexpr int kLeastVersion = 45;
constexpr GLint kStorageBindings = 11;      // 1 + the highest number that a pass binds (blend)
constexpr GLint kStorageBlocks = 7;         // the most that a pass binds (sort_scatter)
constexpr GLint kTextureUnits = 6;          // the most that a pass binds (solid)
constexpr GLint kGroupThreads = 256;        // of the widest pass
constexpr GLint kSharedMemory = 20 * 1024;  // [bytes] of the pass with the most (sort_scatter)

GLint integer(GLenum name) {
  GLint value = 0;
  glGetIntegerv(name, &value);
  return value;
}

std::string text(GLenum name) {
  const auto* value = reinterpret_cast<const char*>(glGetString(name));
  return value ? value : "";
}

// Printed at once as well as kept, as Vulkan's are.
void GLAPIENTRY keepMessage(GLenum source, GLenum type, GLuint, GLenum severity, GLsizei length, const GLchar* message,
                            const void* user) {
  const bool error = type == GL_DEBUG_TYPE_ERROR;
  if (severity == GL_DEBUG_SEVERITY_NOTIFICATION) return;
  // Compilers warn of variables that no path leaves without a value.
  if (source == GL_DEBUG_SOURCE_SHADER_COMPILER && !error) return;
  auto* device = const_cast<GlDevice*>(static_cast<const GlDevice*>(user));
  const std::string said(message, length >= 0 ? static_cast<std::size_t>(length) : std::strlen(message));
  {
    const std::lock_guard lock(device->messages_mutex);
    device->debug_messages.push_back(said);
  }
  std::fprintf(stderr, "opengl: %s\n", said.c_str());
}

constexpr std::pair<GLenum, const char*> kErrors[] = {{GL_INVALID_ENUM, "invalid enum"},
                                                      {GL_INVALID_VALUE, "invalid value"},
                                                      {GL_INVALID_OPERATION, "invalid operation"},
                                                      {GL_OUT_OF_MEMORY, "out of memory"},
                                                      {GL_CONTEXT_LOST, "context lost"}};

const char* errorName(GLenum error) {
  const auto* found = std::ranges::find(kErrors, error, &std::pair<GLenum, const char*>::first);
  return found == std::end(kErrors) ? "error" : found->second;
}

}  // namespace

std::string whatIsMissing() {
  const int version = epoxy_gl_version();
  const auto least = [](GLenum name, GLint wanted, const char* what) {
    const GLint found = integer(name);
    return found >= wanted ? std::string()
                           : std::to_string(wanted) + " " + what + " (it has " + std::to_string(found) + ")";
  };
  if (!epoxy_is_desktop_gl() || version < kLeastVersion) {
    return "OpenGL 4.5 (it has " + std::to_string(version / 10) + "." + std::to_string(version % 10) + ")";
  }
  for (const std::string& missing : {
           least(GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS, kStorageBindings, "bindings of storage buffers"),
           least(GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS, kStorageBlocks, "storage buffers in a compute shader"),
           least(GL_MAX_COMPUTE_TEXTURE_IMAGE_UNITS, kTextureUnits, "textures in a compute shader"),
           least(GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS, kGroupThreads, "threads in a group"),
           least(GL_MAX_COMPUTE_SHARED_MEMORY_SIZE, kSharedMemory, "bytes of shared memory"),
       }) {
    if (!missing.empty()) return missing;
  }
  return {};
}

void describeContext(GlDevice& device, const GlOptions& options) {
  device.limits.device = text(GL_RENDERER);
  GLint64 storage = 0;
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &storage);
  device.limits.storage_bytes = wholeStorageBytes(storage);
  device.limits.texel_elements = static_cast<std::uint32_t>(integer(GL_MAX_TEXTURE_BUFFER_SIZE));
  device.limits.image_side = static_cast<std::uint32_t>(integer(GL_MAX_TEXTURE_SIZE));
  device.uniform_alignment = static_cast<std::uint32_t>(std::max(integer(GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT), 1));
  for (const char* renderer : {"llvmpipe", "softpipe", "SWR", "swrast", "Software Rasterizer"}) {
    device.software = device.software || device.limits.device.find(renderer) != std::string::npos;
  }
  device.spirv = !options.text && epoxy_has_gl_extension("GL_ARB_gl_spirv");
  device.time_stamps = !device.software;  // llvmpipe's leave compute shaders out
  device.reset_status = integer(GL_RESET_NOTIFICATION_STRATEGY) == GL_LOSE_CONTEXT_ON_RESET;
  device.debug = options.debug && (integer(GL_CONTEXT_FLAGS) & GL_CONTEXT_FLAG_DEBUG_BIT) != 0;
  if (!device.debug) return;
  glEnable(GL_DEBUG_OUTPUT);
  glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
  glDebugMessageCallback(keepMessage, &device);
}

std::unique_ptr<GlDevice> wrapGlContext(const GlOptions& options) {
  const std::string missing = whatIsMissing();
  if (!missing.empty()) {
    throw Error(ErrorKind::device, "OpenGL: \"" + text(GL_RENDERER) + "\" lacks " + missing);
  }
  auto device = std::make_unique<GlDevice>();
  describeContext(*device, options);
  return device;
}

void checkGl(const GlDevice& device, const char* what) {
  if (device.reset_status && glGetGraphicsResetStatus() != GL_NO_ERROR) {
    throw Error(ErrorKind::device, device.limits.device, std::string("OpenGL: the context is lost in ") + what);
  }
  const GLenum error = glGetError();
  if (error == GL_NO_ERROR) return;
  while (glGetError() != GL_NO_ERROR && error != GL_CONTEXT_LOST) {
  }
  const std::string message =
      "OpenGL: " + std::string(errorName(error)) + " (" + std::to_string(error) + ") in " + what;
  if (error == GL_OUT_OF_MEMORY) throw DoesNotFit(ErrorKind::device, device.limits.device, message);
  throw Error(ErrorKind::device, device.limits.device, message);
}

}  // namespace tg
