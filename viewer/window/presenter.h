// SPDX-License-Identifier: Apache-2.0
// The swapchain, and the command buffers that fill it: picture by blit, panels by a render pass over it.
#pragma once
#include <vulkan/vulkan.h>
#include <functional>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <vector>

#include "core/image/image.h"
#include "render/vulkan/vulkan_renderer.h"
#include "viewer/window/screen.h"

namespace tg {

// One side of an image barrier.
struct ImageUse {
  VkPipelineStageFlags stage;
  VkAccessFlags access;
  VkImageLayout layout;
};
// Makes writes of `before` visible to `after` on the whole image and changes its layout.
void imageBarrier(VkCommandBuffer commands, VkImage image, ImageUse before, ImageUse after);

// Use: acquire, beginFrame, ..., submit, read, present. Pictures come from another thread, so that a frame is a few
// copies and the panels; but where the device has one queue it also waits for the picture under way. The host waits
// for a frame only when as many of them are in flight as there may be.
class Presenter {
 public:
  // `device` has a surface and outlives this.
  Presenter(VulkanDevice& device, int frames_in_flight);
  ~Presenter();
  Presenter& operator=(Presenter&&) = delete;

  VkRenderPass renderPass() const { return render_pass_; }
  glm::ivec2 size() const { return {static_cast<int>(extent_.width), static_cast<int>(extent_.height)}; }

  // (Re)makes the swapchain where needed. False: the window shows nothing now (minimised, or the window system takes no
  // image); try again later.
  bool acquire(glm::ivec2 framebuffer_size);
  VkCommandBuffer beginFrame();
  // Clears the window and scales the pictures into it, in their order. Their images, as `image_of` has them, are in
  // layout GENERAL and no longer written; they are held until the frame has ended.
  void recordPictures(std::span<const PictureBlit> pictures, VkImage (*image_of)(const PictureImage&), glm::vec3 clear);
  void beginPanels();  // render pass over what is there
  void endPanels();
  void submit();
  void present();

  // Until nothing is under way. Never throws: on a lost device nothing is.
  void waitIdle();
  // Work beside the frames, which is waited for.
  void runOnce(const std::function<void(VkCommandBuffer)>& record);
  // Pixels of an RGBA8 image in layout GENERAL, as 3 channels. Outside of beginFrame .. submit.
  Image read(VkImage image, glm::ivec2 size);
  // All that is on screen, between submit and present. Throws Error(device) where the surface forbids it.
  Image readWindow();

 private:
  // A command buffer and what tells that it has executed.
  struct Submission {
    VkCommandBuffer commands = VK_NULL_HANDLE;
    VkFence fence = VK_NULL_HANDLE;
    bool under_way = false;
    VkSemaphore acquired = VK_NULL_HANDLE;            // a frame's: its image may be written
    std::vector<std::shared_ptr<const PictureImage>> pictures;  // a frame's: those that it reads
  };
  // An image of the swapchain.
  struct Target {
    VkImage image = VK_NULL_HANDLE;
    VkImageView view = VK_NULL_HANDLE;
    VkFramebuffer framebuffer = VK_NULL_HANDLE;
    VkSemaphore drawn = VK_NULL_HANDLE;
  };

  Submission makeSubmission();
  void begin(Submission& submission);
  void submit(Submission& submission, VkSemaphore wait, VkSemaphore signal);
  void await(Submission& submission);
  void releaseEnded();
  void createRenderPass();
  void createSwapchain(glm::ivec2 framebuffer_size);
  void destroyTargets();
  Image copyOut(VkImage image, VkImageLayout layout, VkImageLayout layout_after, glm::ivec2 size, bool bgr);

  VulkanDevice& device_;
  VkSurfaceFormatKHR format_{};
  bool readable_ = false;
  VkRenderPass render_pass_ = VK_NULL_HANDLE;
  VkSwapchainKHR swapchain_ = VK_NULL_HANDLE;
  VkExtent2D extent_{};
  std::vector<Target> targets_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  Submission once_;
  std::vector<Submission> frames_;  // as many as may be in flight
  std::size_t frame_ = 0;           // of those, the one at hand
  bool stale_ = false;              // still presentable, but no longer what the window wants
  std::uint32_t index_ = 0;         // of the target at hand
};

}  // namespace tg
