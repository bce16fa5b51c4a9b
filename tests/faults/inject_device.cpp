// SPDX-License-Identifier: Apache-2.0
// Calls of Vulkan, OpenGL and EGL that fail. Kinds: vulkan (no memory, or a lost device where the call waits or
// submits), gl (no memory), gl-lost (the context is gone from that call on), egl.
#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#define VK_NO_PROTOTYPES
#include <vulkan/vulkan.h>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <mutex>
#include <utility>

#include "inject.h"

namespace tg::test {
namespace {

struct Name {
  const char* text;
};

using Word = std::uintptr_t;

std::atomic<Word> queue;  // the last one that got work

// Every call below takes numbers, handles and pointers alone, eight at most: as many words hold them, whatever they are
// (System V on x86-64, AArch64).
VkResult callVulkan(const char* name, VkResult error, Word a, Word b, Word c, Word d, Word e, Word f, Word g, Word h) {
  using Function = VkResult (*)(Word, Word, Word, Word, Word, Word, Word, Word);
  const auto real = reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
  if (std::strcmp(name, "vkQueueSubmit") == 0) queue = a;
  if (!isChosen("vulkan", name)) return real(a, b, c, d, e, f, g, h);
  if (error == VK_ERROR_DEVICE_LOST) {
    real(a, b, c, d, e, f, g, h);
    // A lost device runs nothing: what it was told has come to its end when the program hears of it.
    if (queue != 0) reinterpret_cast<VkResult (*)(Word)>(dlsym(RTLD_NEXT, "vkQueueWaitIdle"))(queue);
  }
  return error;
}

thread_local GLenum next_error = GL_NO_ERROR;
std::atomic<bool> lost{false};

// libepoxy's variable for a function, with a wrapper in it. At the first call libepoxy writes the function's address
// there, and calls what stands there then.
template <const Name& name, typename Function>
class Taken {
 public:
  static void take(Function with) {
    variable = static_cast<Function*>(dlsym(RTLD_DEFAULT, name.text));
    if (!variable) return;
    wrapper = with;
    real = std::exchange(*variable, wrapper);
  }

  template <typename... Arguments>
  static auto call(Arguments... arguments) {
    if (resolved) return real(arguments...);
    const std::lock_guard lock(resolving);
    if (resolved) return real(arguments...);
    struct Back {
      Back() { *variable = real; }
      ~Back() {
        real = std::exchange(*variable, wrapper);
        resolved = true;
      }
    } back;
    return real(arguments...);
  }

 private:
  static inline Function* variable = nullptr;
  static inline Function real = nullptr, wrapper = nullptr;
  static inline std::mutex resolving;
  static inline std::atomic<bool> resolved = false;
};

template <const Name& name, typename Function>
struct Gl;
template <const Name& name, typename Result, typename... Arguments>
struct Gl<name, Result (*)(Arguments...)> {
  using Own = Taken<name, Result (*)(Arguments...)>;
  static Result call(Arguments... arguments) {
    if (isChosen("gl-lost", name.text)) lost = true;
    if (!isChosen("gl", name.text)) return Own::call(arguments...);
    next_error = GL_OUT_OF_MEMORY;
    return Result();
  }
};

template <const Name& name, typename Function>
struct Egl;
template <const Name& name, typename Result, typename... Arguments>
struct Egl<name, Result (*)(Arguments...)> {
  using Own = Taken<name, Result (*)(Arguments...)>;
  static Result call(Arguments... arguments) {
    return isChosen("egl", name.text) ? Result() : Own::call(arguments...);
  }
};

constexpr Name kGetError{"epoxy_glGetError"}, kResetStatus{"epoxy_glGetGraphicsResetStatus"};
using Errors = Taken<kGetError, GLenum (*)()>;
using Resets = Taken<kResetStatus, GLenum (*)()>;

GLenum getError() {
  const GLenum wanted = std::exchange(next_error, GL_NO_ERROR);
  const GLenum found = Errors::call();
  return wanted != GL_NO_ERROR ? wanted : found;
}

GLenum resetStatus() {
  const GLenum found = Resets::call();
  return lost ? GL_UNKNOWN_CONTEXT_RESET : found;
}

#define TG_GL_CALLS(X)                                                                                        \
  X(glNamedBufferStorage) X(glNamedBufferSubData) X(glCopyNamedBufferSubData) X(glGetNamedBufferSubData)      \
  X(glClearNamedBufferData) X(glTextureBuffer) X(glTextureStorage2D) X(glTextureSubImage2D)                   \
  X(glDispatchCompute) X(glDispatchComputeIndirect)
#define TG_EGL_CALLS(X) X(eglInitialize) X(eglBindAPI) X(eglCreateContext) X(eglMakeCurrent)

#define TG_NAME(function) constexpr Name kName_##function{"epoxy_" #function};
TG_GL_CALLS(TG_NAME)
TG_EGL_CALLS(TG_NAME)

}  // namespace

void takeGl() {
  Errors::take(getError);
  Resets::take(resetStatus);
#define TG_TAKE_GL(function) \
  Gl<kName_##function, decltype(epoxy_##function)>::Own::take(Gl<kName_##function, decltype(epoxy_##function)>::call);
  TG_GL_CALLS(TG_TAKE_GL)
#define TG_TAKE_EGL(function) \
  Egl<kName_##function, decltype(epoxy_##function)>::Own::take(Egl<kName_##function, decltype(epoxy_##function)>::call);
  TG_EGL_CALLS(TG_TAKE_EGL)
}

}  // namespace tg::test

#define TG_VULKAN(function, error)                                                                 \
  extern "C" VkResult function(tg::test::Word a, tg::test::Word b, tg::test::Word c, tg::test::Word d, \
                               tg::test::Word e, tg::test::Word f, tg::test::Word g, tg::test::Word h) { \
    return tg::test::callVulkan(#function, error, a, b, c, d, e, f, g, h);                         \
  }
#define TG_VULKAN_MEMORY(function) TG_VULKAN(function, VK_ERROR_OUT_OF_DEVICE_MEMORY)
#define TG_VULKAN_LOST(function) TG_VULKAN(function, VK_ERROR_DEVICE_LOST)

TG_VULKAN_MEMORY(vkCreateInstance)
TG_VULKAN_MEMORY(vkEnumeratePhysicalDevices)
TG_VULKAN_MEMORY(vkCreateDevice)
TG_VULKAN_MEMORY(vkAllocateMemory)
TG_VULKAN_MEMORY(vkMapMemory)
TG_VULKAN_MEMORY(vkBindBufferMemory)
TG_VULKAN_MEMORY(vkBindImageMemory)
TG_VULKAN_MEMORY(vkCreateBuffer)
TG_VULKAN_MEMORY(vkCreateBufferView)
TG_VULKAN_MEMORY(vkCreateImage)
TG_VULKAN_MEMORY(vkCreateImageView)
TG_VULKAN_MEMORY(vkCreateFramebuffer)
TG_VULKAN_MEMORY(vkCreateRenderPass)
TG_VULKAN_MEMORY(vkCreateSemaphore)
TG_VULKAN_MEMORY(vkCreateFence)
TG_VULKAN_MEMORY(vkCreateQueryPool)
TG_VULKAN_MEMORY(vkCreateCommandPool)
TG_VULKAN_MEMORY(vkAllocateCommandBuffers)
TG_VULKAN_MEMORY(vkBeginCommandBuffer)
TG_VULKAN_MEMORY(vkEndCommandBuffer)
TG_VULKAN_MEMORY(vkResetCommandPool)
TG_VULKAN_MEMORY(vkCreateDescriptorPool)
TG_VULKAN_MEMORY(vkCreateDescriptorSetLayout)
TG_VULKAN_MEMORY(vkAllocateDescriptorSets)
TG_VULKAN_MEMORY(vkCreatePipelineLayout)
TG_VULKAN_MEMORY(vkCreateShaderModule)
TG_VULKAN_MEMORY(vkCreateComputePipelines)
TG_VULKAN_LOST(vkQueueSubmit)
TG_VULKAN_LOST(vkWaitForFences)
TG_VULKAN_LOST(vkGetFenceStatus)
TG_VULKAN_LOST(vkQueueWaitIdle)
TG_VULKAN_LOST(vkDeviceWaitIdle)
TG_VULKAN_LOST(vkGetQueryPoolResults)
TG_VULKAN_MEMORY(vkCreateSwapchainKHR)
TG_VULKAN_MEMORY(vkGetSwapchainImagesKHR)
TG_VULKAN_MEMORY(vkGetPhysicalDeviceSurfaceCapabilitiesKHR)
TG_VULKAN_MEMORY(vkGetPhysicalDeviceSurfaceFormatsKHR)
TG_VULKAN_LOST(vkAcquireNextImageKHR)
TG_VULKAN_LOST(vkQueuePresentKHR)
