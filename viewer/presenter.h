// SPDX-License-Identifier: Apache-2.0
// The swapchain, and the one command buffer that fills it: picture by blit, panels by a render pass over it.
#pragma once
#include <vulkan/vulkan.h>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/image.h"
#include "render/vulkan/vulkan_renderer.h"
#include "viewer/pixel_rect.h"

namespace tg {

// A part of an image in layout GENERAL, whose writes have finished, and where in the window it goes.
struct ImageBlit {
  VkImage image;
  PixelRect from;
  PixelRect to;
};

// One frame in flight: pictures come from another thread, so that a frame is a few copies and the panels. Use: acquire,
// { beginCommands, ..., submitAndWait } once or more, read, present.
class Presenter {
 public:
  // `device` has a surface and outlives this.
  explicit Presenter(VulkanDevice& device);
  ~Presenter();
  Presenter(const Presenter&) = delete;
  Presenter& operator=(const Presenter&) = delete;

  VkRenderPass renderPass() const { return render_pass_; }
  glm::ivec2 size() const { return {static_cast<int>(extent_.width), static_cast<int>(extent_.height)}; }

  // (Re)makes the swapchain where needed. False: the window shows nothing now (minimised); try again later.
  bool acquire(glm::ivec2 framebuffer_size);
  VkCommandBuffer beginCommands();
  // Clears the window and scales the pictures into it, in their order.
  void recordPictures(std::span<const ImageBlit> pictures, glm::vec3 clear);
  void beginPanels();  // render pass over what is there
  void endPanels();
  void submitAndWait();
  void present();

  // Pixels of an RGBA8 image in layout GENERAL, as 3 channels. Outside of beginCommands .. submitAndWait.
  Image read(VkImage image, glm::ivec2 size);
  // All that is on screen, between submitAndWait and present. Throws Error(device) where the surface forbids it.
  Image readWindow();

 private:
  void waitIdle();
  void createRenderPass();
  void createSwapchain(glm::ivec2 framebuffer_size);
  void destroyImages();
  Image copyOut(VkImage image, VkImageLayout layout, VkImageLayout layout_after, glm::ivec2 size, bool bgr);

  VulkanDevice& device_;
  VkSurfaceFormatKHR format_{};
  bool readable_ = false;
  VkRenderPass render_pass_ = VK_NULL_HANDLE;
  VkSwapchainKHR swapchain_ = VK_NULL_HANDLE;
  VkExtent2D extent_{};
  std::vector<VkImage> images_;
  std::vector<VkImageView> views_;
  std::vector<VkFramebuffer> framebuffers_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkFence fence_ = VK_NULL_HANDLE;
  VkSemaphore acquired_ = VK_NULL_HANDLE;
  bool wait_for_acquire_ = false;  // the first submission after acquire waits for the image
  bool stale_ = false;             // still presentable, but no longer what the window wants
  std::uint32_t index_ = 0;
};

}  // namespace tg
