// SPDX-License-Identifier: Apache-2.0
// Swapchain, blit and read-back.
#include "viewer/window/presenter.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/system/error.h"
#include "render/vulkan/buffer.h"
#include "render/vulkan/check.h"

namespace tg {
namespace {

constexpr std::uint64_t kDeviceTimeout = 300'000'000'000;  // [ns] software devices compile shaders in the first frame
constexpr std::uint64_t kImageTimeout = 250'000'000;       // [ns] a hidden window may get none before it is seen again

// The picture holds display-referred numbers: an _SRGB format would encode them twice.
VkSurfaceFormatKHR chooseFormat(VkPhysicalDevice physical, VkSurfaceKHR surface) {
  std::uint32_t count = 0;
  TG_VK(vkGetPhysicalDeviceSurfaceFormatsKHR(physical, surface, &count, nullptr));
  std::vector<VkSurfaceFormatKHR> formats(count);
  TG_VK(vkGetPhysicalDeviceSurfaceFormatsKHR(physical, surface, &count, formats.data()));
  for (VkFormat wanted : {VK_FORMAT_B8G8R8A8_UNORM, VK_FORMAT_R8G8B8A8_UNORM}) {
    for (const VkSurfaceFormatKHR& format : formats) {
      if (format.format == wanted && format.colorSpace == VK_COLOR_SPACE_SRGB_NONLINEAR_KHR) return format;
    }
  }
  throw Error(ErrorKind::device, "the window offers no 8-bit UNORM format (expected B8G8R8A8 or R8G8B8A8)");
}

VkSurfaceCapabilitiesKHR capabilitiesOf(const VulkanDevice& device) {
  VkSurfaceCapabilitiesKHR capabilities;
  TG_VK(vkGetPhysicalDeviceSurfaceCapabilitiesKHR(device.physical, device.surface, &capabilities));
  return capabilities;
}

constexpr VkImageSubresourceRange kColor{VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
constexpr VkImageSubresourceLayers kColorLayer{VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};

constexpr VkPipelineStageFlags kTransfer = VK_PIPELINE_STAGE_TRANSFER_BIT;
constexpr VkPipelineStageFlags kColorStage = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;

VkSemaphore makeSemaphore(VkDevice device) {
  const VkSemaphoreCreateInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO};
  VkSemaphore semaphore = VK_NULL_HANDLE;
  TG_VK(vkCreateSemaphore(device, &info, nullptr, &semaphore));
  return semaphore;
}

}  // namespace

void imageBarrier(VkCommandBuffer commands, VkImage image, ImageUse before, ImageUse after) {
  VkImageMemoryBarrier info{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER};
  info.srcAccessMask = before.access;
  info.dstAccessMask = after.access;
  info.oldLayout = before.layout;
  info.newLayout = after.layout;
  info.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  info.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  info.image = image;
  info.subresourceRange = kColor;
  vkCmdPipelineBarrier(commands, before.stage, after.stage, 0, 0, nullptr, 0, nullptr, 1, &info);
}

Presenter::Presenter(VulkanDevice& device, int frames_in_flight) : device_(device) {
  format_ = chooseFormat(device_.physical, device_.surface);
  if (!(capabilitiesOf(device_).supportedUsageFlags & VK_IMAGE_USAGE_TRANSFER_DST_BIT)) {
    throw Error(ErrorKind::device, "Vulkan: this window system does not let pictures be copied into a window");
  }
  createRenderPass();
  VkCommandPoolCreateInfo pool{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
  pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  pool.queueFamilyIndex = device_.queue_family;
  TG_VK(vkCreateCommandPool(device_.device, &pool, nullptr, &pool_));
  once_ = makeSubmission();
  for (int i = 0; i < frames_in_flight; ++i) {
    Submission frame = makeSubmission();
    frame.acquired = makeSemaphore(device_.device);
    frames_.push_back(std::move(frame));
  }
}

Presenter::~Presenter() {
  waitIdle();
  destroyTargets();
  vkDestroySwapchainKHR(device_.device, swapchain_, nullptr);
  vkDestroyRenderPass(device_.device, render_pass_, nullptr);
  frames_.push_back(std::move(once_));
  for (const Submission& submission : frames_) {
    vkDestroySemaphore(device_.device, submission.acquired, nullptr);
    vkDestroyFence(device_.device, submission.fence, nullptr);
  }
  vkDestroyCommandPool(device_.device, pool_, nullptr);
}

void Presenter::waitIdle() {
  const std::lock_guard lock(device_.mutexOf(device_.window_queue));
  vkQueueWaitIdle(device_.window_queue);
}

Presenter::Submission Presenter::makeSubmission() {
  Submission submission;
  VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
  allocate.commandPool = pool_;
  allocate.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  allocate.commandBufferCount = 1;
  TG_VK(vkAllocateCommandBuffers(device_.device, &allocate, &submission.commands));
  VkFenceCreateInfo fence{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
  TG_VK(vkCreateFence(device_.device, &fence, nullptr, &submission.fence));
  return submission;
}

void Presenter::begin(Submission& submission) {
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  TG_VK(vkBeginCommandBuffer(submission.commands, &begin));
}

// `wait` and `signal` may be null.
void Presenter::submit(Submission& submission, VkSemaphore wait, VkSemaphore signal) {
  TG_VK(vkEndCommandBuffer(submission.commands));
  const VkPipelineStageFlags stage = kTransfer;
  VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
  submit.waitSemaphoreCount = wait ? 1 : 0;
  submit.pWaitSemaphores = &wait;
  submit.pWaitDstStageMask = &stage;
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &submission.commands;
  submit.signalSemaphoreCount = signal ? 1 : 0;
  submit.pSignalSemaphores = &signal;
  const std::lock_guard lock(device_.mutexOf(device_.window_queue));
  TG_VK(vkQueueSubmit(device_.window_queue, 1, &submit, submission.fence));
  submission.under_way = true;
}

void Presenter::await(Submission& submission) {
  if (!submission.under_way) return;
  const VkResult waited = vkWaitForFences(device_.device, 1, &submission.fence, VK_TRUE, kDeviceTimeout);
  if (waited == VK_TIMEOUT) {
    throw Error(ErrorKind::device,
                "Vulkan: waited " + std::to_string(kDeviceTimeout / 1'000'000'000) + " s for a frame");
  }
  TG_VK(waited);
  TG_VK(vkResetFences(device_.device, 1, &submission.fence));
  submission.under_way = false;
  submission.pictures.clear();
}

// Pictures that no frame reads any more are the picture thread's again.
void Presenter::releaseEnded() {
  for (Submission& frame : frames_) {
    if (frame.under_way && vkGetFenceStatus(device_.device, frame.fence) == VK_SUCCESS) await(frame);
  }
}

void Presenter::createRenderPass() {
  VkAttachmentDescription color{};
  color.format = format_.format;
  color.samples = VK_SAMPLE_COUNT_1_BIT;
  color.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  color.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  color.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  color.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  color.initialLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
  color.finalLayout = VK_IMAGE_LAYOUT_PRESENT_SRC_KHR;
  const VkAttachmentReference reference{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass{};
  subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &reference;
  VkRenderPassCreateInfo info{VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO};
  info.attachmentCount = 1;
  info.pAttachments = &color;
  info.subpassCount = 1;
  info.pSubpasses = &subpass;
  TG_VK(vkCreateRenderPass(device_.device, &info, nullptr, &render_pass_));
}

void Presenter::destroyTargets() {
  for (const Target& target : targets_) {
    vkDestroyFramebuffer(device_.device, target.framebuffer, nullptr);
    vkDestroyImageView(device_.device, target.view, nullptr);
    vkDestroySemaphore(device_.device, target.drawn, nullptr);
  }
  targets_.clear();
}

void Presenter::createSwapchain(glm::ivec2 framebuffer_size) {
  for (Submission& frame : frames_) await(frame);
  waitIdle();  // for what the window system does with an image
  const VkSurfaceCapabilitiesKHR capabilities = capabilitiesOf(device_);
  extent_ = capabilities.currentExtent;
  if (extent_.width == UINT32_MAX) {  // the window follows the swapchain (Wayland)
    const VkExtent2D low = capabilities.minImageExtent, high = capabilities.maxImageExtent;
    extent_.width = std::clamp(static_cast<std::uint32_t>(framebuffer_size.x), low.width, high.width);
    extent_.height = std::clamp(static_cast<std::uint32_t>(framebuffer_size.y), low.height, high.height);
  }
  destroyTargets();
  if (extent_.width == 0 || extent_.height == 0) return;

  readable_ = (capabilities.supportedUsageFlags & VK_IMAGE_USAGE_TRANSFER_SRC_BIT) != 0;
  VkSwapchainCreateInfoKHR info{VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR};
  info.surface = device_.surface;
  info.minImageCount = std::max(static_cast<std::uint32_t>(frames_.size()) + 1, capabilities.minImageCount);
  if (capabilities.maxImageCount > 0) info.minImageCount = std::min(info.minImageCount, capabilities.maxImageCount);
  info.imageFormat = format_.format;
  info.imageColorSpace = format_.colorSpace;
  info.imageExtent = extent_;
  info.imageArrayLayers = 1;
  info.imageUsage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  if (readable_) info.imageUsage |= VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  info.imageSharingMode = VK_SHARING_MODE_EXCLUSIVE;
  info.preTransform = capabilities.currentTransform;
  // Opaque where it exists; every surface offers at least one way.
  info.compositeAlpha = VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR;
  while (!(capabilities.supportedCompositeAlpha & info.compositeAlpha)) {
    info.compositeAlpha = static_cast<VkCompositeAlphaFlagBitsKHR>(info.compositeAlpha << 1);
  }
  info.presentMode = VK_PRESENT_MODE_FIFO_KHR;
  info.clipped = VK_FALSE;  // read-back needs hidden pixels too
  info.oldSwapchain = swapchain_;
  VkSwapchainKHR fresh = VK_NULL_HANDLE;
  TG_VK(vkCreateSwapchainKHR(device_.device, &info, nullptr, &fresh));
  vkDestroySwapchainKHR(device_.device, swapchain_, nullptr);
  swapchain_ = fresh;
  stale_ = false;

  std::uint32_t count = 0;
  TG_VK(vkGetSwapchainImagesKHR(device_.device, swapchain_, &count, nullptr));
  std::vector<VkImage> images(count);
  TG_VK(vkGetSwapchainImagesKHR(device_.device, swapchain_, &count, images.data()));
  for (VkImage image : images) {
    Target& target = targets_.emplace_back();
    target.image = image;
    target.drawn = makeSemaphore(device_.device);
    VkImageViewCreateInfo view{VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO};
    view.image = image;
    view.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.format = format_.format;
    view.subresourceRange = kColor;
    TG_VK(vkCreateImageView(device_.device, &view, nullptr, &target.view));
    VkFramebufferCreateInfo framebuffer{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO};
    framebuffer.renderPass = render_pass_;
    framebuffer.attachmentCount = 1;
    framebuffer.pAttachments = &target.view;
    framebuffer.width = extent_.width;
    framebuffer.height = extent_.height;
    framebuffer.layers = 1;
    TG_VK(vkCreateFramebuffer(device_.device, &framebuffer, nullptr, &target.framebuffer));
  }
}

bool Presenter::acquire(glm::ivec2 framebuffer_size) {
  releaseEnded();
  if (framebuffer_size.x <= 0 || framebuffer_size.y <= 0) return false;
  frame_ = (frame_ + 1) % frames_.size();
  await(frames_[frame_]);
  // While a window is being dragged, sizes can go out of date as fast as they are asked for.
  for (int attempt = 0; attempt < 8; ++attempt) {
    if (targets_.empty() || stale_ || size() != framebuffer_size) createSwapchain(framebuffer_size);
    if (targets_.empty()) return false;
    const VkResult result = vkAcquireNextImageKHR(device_.device, swapchain_, kImageTimeout, frames_[frame_].acquired,
                                                  VK_NULL_HANDLE, &index_);
    if (result == VK_ERROR_OUT_OF_DATE_KHR) {
      stale_ = true;
      continue;
    }
    if (result == VK_TIMEOUT || result == VK_NOT_READY) return false;
    stale_ = result == VK_SUBOPTIMAL_KHR;
    TG_VK(result);
    return true;
  }
  return false;
}

VkCommandBuffer Presenter::beginFrame() {
  begin(frames_[frame_]);
  return frames_[frame_].commands;
}

void Presenter::recordPictures(std::span<const PictureBlit> pictures, VkImage (*image_of)(const PictureImage&),
                               glm::vec3 clear) {
  Submission& frame = frames_[frame_];
  const VkCommandBuffer commands = frame.commands;
  const VkImage target = targets_[index_].image;
  // The stage is the one that the acquire semaphore holds back.
  imageBarrier(commands, target, {kTransfer, 0, VK_IMAGE_LAYOUT_UNDEFINED},
               {kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL});
  const VkClearColorValue color{{clear.r, clear.g, clear.b, 1.0f}};
  vkCmdClearColorImage(commands, target, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, &color, 1, &kColor);
  const ImageUse cleared{kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL};
  for (const PictureBlit& picture : pictures) {
    const VkImage image = image_of(*picture.image);
    imageBarrier(commands, target, cleared, cleared);
    // Written by another submission, perhaps of another queue, that a fence has told the end of.
    imageBarrier(commands, image, {kTransfer, VK_ACCESS_MEMORY_WRITE_BIT, VK_IMAGE_LAYOUT_GENERAL},
                 {kTransfer, VK_ACCESS_TRANSFER_READ_BIT, VK_IMAGE_LAYOUT_GENERAL});
    frame.pictures.push_back(picture.image);
    const auto corner = [](glm::ivec2 at, std::int32_t z) { return VkOffset3D{at.x, at.y, z}; };
    VkImageBlit blit{};
    blit.srcSubresource = kColorLayer;
    blit.srcOffsets[0] = corner(picture.from.origin, 0);
    blit.srcOffsets[1] = corner(picture.from.origin + picture.from.size, 1);
    blit.dstSubresource = kColorLayer;
    blit.dstOffsets[0] = corner(picture.to.origin, 0);
    blit.dstOffsets[1] = corner(picture.to.origin + picture.to.size, 1);
    vkCmdBlitImage(commands, image, VK_IMAGE_LAYOUT_GENERAL, target, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &blit,
                   picture.from.size == picture.to.size ? VK_FILTER_NEAREST : VK_FILTER_LINEAR);
  }
  imageBarrier(commands, target, cleared,
               {kColorStage, VK_ACCESS_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT,
                VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL});
}

void Presenter::beginPanels() {
  VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO};
  begin.renderPass = render_pass_;
  begin.framebuffer = targets_[index_].framebuffer;
  begin.renderArea.extent = extent_;
  vkCmdBeginRenderPass(frames_[frame_].commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
}

void Presenter::endPanels() { vkCmdEndRenderPass(frames_[frame_].commands); }

void Presenter::submit() { submit(frames_[frame_], frames_[frame_].acquired, targets_[index_].drawn); }

void Presenter::runOnce(const std::function<void(VkCommandBuffer)>& record) {
  begin(once_);
  record(once_.commands);
  submit(once_, VK_NULL_HANDLE, VK_NULL_HANDLE);
  await(once_);
}

void Presenter::present() {
  VkPresentInfoKHR info{VK_STRUCTURE_TYPE_PRESENT_INFO_KHR};
  info.waitSemaphoreCount = 1;
  info.pWaitSemaphores = &targets_[index_].drawn;
  info.swapchainCount = 1;
  info.pSwapchains = &swapchain_;
  info.pImageIndices = &index_;
  VkResult result = VK_SUCCESS;
  {
    const std::lock_guard lock(device_.mutexOf(device_.window_queue));
    // Has no time-out: some drivers wait here for a hidden window to be seen.
    result = vkQueuePresentKHR(device_.window_queue, &info);
  }
  if (result == VK_ERROR_OUT_OF_DATE_KHR || result == VK_SUBOPTIMAL_KHR) {
    stale_ = true;
  } else {
    TG_VK(result);
  }
}

Image Presenter::copyOut(VkImage image, VkImageLayout layout, VkImageLayout layout_after, glm::ivec2 size, bool bgr) {
  const std::size_t pixels = static_cast<std::size_t>(size.x) * size.y;
  const Buffer buffer(device_, "a screenshot", pixels * 4, Memory::readBack);
  runOnce([&](VkCommandBuffer commands) {
    imageBarrier(commands, image, {VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_ACCESS_MEMORY_WRITE_BIT, layout},
                 {kTransfer, VK_ACCESS_TRANSFER_READ_BIT, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL});
    VkBufferImageCopy copy{};
    copy.imageSubresource = kColorLayer;
    copy.imageExtent = {static_cast<std::uint32_t>(size.x), static_cast<std::uint32_t>(size.y), 1};
    vkCmdCopyImageToBuffer(commands, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, buffer.handle(), 1, &copy);
    imageBarrier(commands, image, {kTransfer, VK_ACCESS_TRANSFER_READ_BIT, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL},
                 {VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_ACCESS_MEMORY_READ_BIT, layout_after});
    VkMemoryBarrier to_host{VK_STRUCTURE_TYPE_MEMORY_BARRIER};
    to_host.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
    to_host.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
    vkCmdPipelineBarrier(commands, kTransfer, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &to_host, 0, nullptr, 0, nullptr);
  });

  Image result = imageFromRgba8({buffer.data(), pixels * 4}, size.x, size.y);
  for (std::size_t i = 0; i < pixels && bgr; ++i) std::swap(result.data[i * 3], result.data[i * 3 + 2]);
  return result;
}

Image Presenter::read(VkImage image, glm::ivec2 size) {
  return copyOut(image, VK_IMAGE_LAYOUT_GENERAL, VK_IMAGE_LAYOUT_GENERAL, size, false);
}

Image Presenter::readWindow() {
  if (!readable_) throw Error(ErrorKind::device, "this window system does not let its pixels be read back");
  return copyOut(targets_[index_].image, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR, size(),
                 format_.format == VK_FORMAT_B8G8R8A8_UNORM);
}

}  // namespace tg
