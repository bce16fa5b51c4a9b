// SPDX-License-Identifier: Apache-2.0
// Memory: allocation by kind, staged copies.
#include "render/vulkan/buffer.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "render/vulkan/check.h"

namespace tg {
namespace {

constexpr VkDeviceSize kStagingBytes = VkDeviceSize{16} << 20;

std::uint32_t findMemoryType(const VulkanDevice& device, std::uint32_t allowed, VkMemoryPropertyFlags wanted) {
  VkPhysicalDeviceMemoryProperties memory;
  vkGetPhysicalDeviceMemoryProperties(device.physical, &memory);
  // Cached memory is a wish: without it the host reads slowly.
  for (const VkMemoryPropertyFlags flags : {wanted, wanted & ~VK_MEMORY_PROPERTY_HOST_CACHED_BIT}) {
    for (std::uint32_t i = 0; i < memory.memoryTypeCount; ++i) {
      if ((allowed >> i & 1) && (memory.memoryTypes[i].propertyFlags & flags) == flags) return i;
    }
  }
  throw Error(ErrorKind::device, device.properties.deviceName, "no memory type with flags " + std::to_string(wanted));
}

VkMemoryPropertyFlags flagsOf(Memory memory) {
  if (memory == Memory::device) return VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
  const VkMemoryPropertyFlags host = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  return memory == Memory::readBack ? host | VK_MEMORY_PROPERTY_HOST_CACHED_BIT : host;
}

// Of making `name`, of so many bytes, or a part of it.
void checkMade(const VulkanDevice& device, VkResult result, const char* name, VkDeviceSize bytes) {
  if (result == VK_ERROR_OUT_OF_DEVICE_MEMORY || result == VK_ERROR_OUT_OF_HOST_MEMORY) {
    throw DoesNotFit(ErrorKind::device, device.properties.deviceName,
                     "no memory for " + std::string(name) + " (" + std::to_string(bytes >> 20) + " MiB)");
  }
  checkVulkan(result, ("making " + std::string(name)).c_str());
}

VkDeviceMemory allocate(const VulkanDevice& device, const VkMemoryRequirements& needs, VkMemoryPropertyFlags flags,
                        const char* name) {
  VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
  info.allocationSize = needs.size;
  info.memoryTypeIndex = findMemoryType(device, needs.memoryTypeBits, flags);
  VkDeviceMemory memory = VK_NULL_HANDLE;
  checkMade(device, vkAllocateMemory(device.device, &info, nullptr, &memory), name, needs.size);
  return memory;
}

VkAccessFlags accessOf(VkPipelineStageFlags stages, bool writes) {
  VkAccessFlags access = 0;
  if (stages & VK_PIPELINE_STAGE_TRANSFER_BIT) {
    access |= VK_ACCESS_TRANSFER_WRITE_BIT | (writes ? 0 : VK_ACCESS_TRANSFER_READ_BIT);
  }
  if (stages & VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT) {
    access |= VK_ACCESS_SHADER_WRITE_BIT | (writes ? 0 : VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_UNIFORM_READ_BIT);
  }
  if ((stages & VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT) && !writes) access |= VK_ACCESS_INDIRECT_COMMAND_READ_BIT;
  if (stages & VK_PIPELINE_STAGE_HOST_BIT) access |= writes ? VK_ACCESS_HOST_WRITE_BIT : VK_ACCESS_HOST_READ_BIT;
  return access;
}

}  // namespace

Buffer::Buffer(const VulkanDevice& device, const char* name, VkDeviceSize bytes, Memory memory)
    : device_(&device), name_(name), size_(bufferBytes(bytes)) {
  VkBufferCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
  info.size = allocatedBytes(size_);
  info.usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  info.usage |= memory != Memory::device ? VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT
                                         : VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT |
                                               VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT;
  try {
    checkMade(device, vkCreateBuffer(device.device, &info, nullptr, &buffer_), name, info.size);
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(device.device, buffer_, &needs);
    memory_ = allocate(device, needs, flagsOf(memory), name);
    checkMade(device, vkBindBufferMemory(device.device, buffer_, memory_, 0), name, info.size);
    if (memory != Memory::device) {
      void* mapped = nullptr;
      checkMade(device, vkMapMemory(device.device, memory_, 0, VK_WHOLE_SIZE, 0, &mapped), name, info.size);
      data_ = static_cast<std::byte*>(mapped);
    }
  } catch (...) {
    vkDestroyBuffer(device.device, buffer_, nullptr);
    vkFreeMemory(device.device, memory_, nullptr);
    throw;
  }
}

Buffer::~Buffer() {
  if (!device_) return;
  for (const auto& [format, view] : views_) vkDestroyBufferView(device_->device, view, nullptr);
  vkDestroyBuffer(device_->device, buffer_, nullptr);
  vkFreeMemory(device_->device, memory_, nullptr);
}

VkBufferView Buffer::view(VkFormat format) const {
  for (const auto& [known, view] : views_) {
    if (known == format) return view;
  }
  const VkDeviceSize element = format == VK_FORMAT_R32_UINT ? 4 : format == VK_FORMAT_R16G16B16A16_SFLOAT ? 8 : 16;
  const std::uint32_t most = device_->properties.limits.maxTexelBufferElements;
  if (size_ / element > most) {
    throw Error(ErrorKind::device, device_->properties.deviceName,
                std::string(name_) + ": " + std::to_string(size_ / element) + " elements (expected at most " +
                    std::to_string(most) + ")");
  }
  VkBufferViewCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO};
  info.buffer = buffer_;
  info.format = format;
  info.range = std::min<VkDeviceSize>(allocatedBytes(size_) / element, most) * element;
  VkBufferView view = VK_NULL_HANDLE;
  checkMade(*device_, vkCreateBufferView(device_->device, &info, nullptr, &view), name_, size_);
  views_.emplace_back(format, view);
  return view;
}

void Buffer::swap(Buffer& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(name_, other.name_);
  std::swap(views_, other.views_);
  std::swap(buffer_, other.buffer_);
  std::swap(memory_, other.memory_);
  std::swap(size_, other.size_);
  std::swap(data_, other.data_);
}

StorageImage::StorageImage(const VulkanDevice& device, std::uint32_t width, std::uint32_t height)
    : device_(device.device) {
  const std::uint32_t most = device.properties.limits.maxImageDimension2D;
  if (std::max(width, height) > most) {
    throw Error(ErrorKind::device, device.properties.deviceName,
                "a picture of " + std::to_string(width) + " x " + std::to_string(height) +
                    " is too large (expected at most " + std::to_string(most) + " a side)");
  }
  VkImageCreateInfo info{VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO};
  info.imageType = VK_IMAGE_TYPE_2D;
  info.format = VK_FORMAT_R8G8B8A8_UNORM;
  info.extent = {width, height, 1};
  info.mipLevels = 1;
  info.arrayLayers = 1;
  info.samples = VK_SAMPLE_COUNT_1_BIT;
  info.usage = VK_IMAGE_USAGE_STORAGE_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  VkImageViewCreateInfo view{VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO};
  view.viewType = VK_IMAGE_VIEW_TYPE_2D;
  view.format = info.format;
  view.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
  const VkDeviceSize bytes = VkDeviceSize{4} * width * height;
  const auto check = [&](VkResult result) { checkMade(device, result, "the picture", bytes); };
  try {
    check(vkCreateImage(device_, &info, nullptr, &image_));
    VkMemoryRequirements needs;
    vkGetImageMemoryRequirements(device_, image_, &needs);
    memory_ = allocate(device, needs, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, "the picture");
    check(vkBindImageMemory(device_, image_, memory_, 0));
    view.image = image_;
    check(vkCreateImageView(device_, &view, nullptr, &view_));
  } catch (...) {
    vkDestroyImage(device_, image_, nullptr);
    vkFreeMemory(device_, memory_, nullptr);
    throw;
  }
}

StorageImage::~StorageImage() {
  if (!device_) return;
  vkDestroyImageView(device_, view_, nullptr);
  vkDestroyImage(device_, image_, nullptr);
  vkFreeMemory(device_, memory_, nullptr);
}

void StorageImage::swap(StorageImage& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(image_, other.image_);
  std::swap(memory_, other.memory_);
  std::swap(view_, other.view_);
}

Commands::Commands(const VulkanDevice& device) : device_(device) {
  VkCommandPoolCreateInfo pool{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
  pool.flags = VK_COMMAND_POOL_CREATE_TRANSIENT_BIT;
  pool.queueFamilyIndex = device.queue_family;
  TG_VK(vkCreateCommandPool(device.device, &pool, nullptr, &pool_));
  VkCommandBufferAllocateInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
  info.commandPool = pool_;
  info.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  info.commandBufferCount = 1;
  VkFenceCreateInfo fence{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
  try {
    TG_VK(vkAllocateCommandBuffers(device.device, &info, &commands_));
    TG_VK(vkCreateFence(device.device, &fence, nullptr, &fence_));
  } catch (...) {
    vkDestroyCommandPool(device.device, pool_, nullptr);
    throw;
  }
}

Commands::~Commands() {
  vkDestroyFence(device_.device, fence_, nullptr);
  vkDestroyCommandPool(device_.device, pool_, nullptr);
}

void Commands::run(const std::function<void(VkCommandBuffer)>& record) {
  start(record);
  finish();
}

void Commands::start(const std::function<void(VkCommandBuffer)>& record) {
  TG_VK(vkResetCommandPool(device_.device, pool_, 0));
  VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  TG_VK(vkBeginCommandBuffer(commands_, &begin));
  record(commands_);
  TG_VK(vkEndCommandBuffer(commands_));
  VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commands_;
  const std::lock_guard lock(device_.mutexOf(device_.queue));
  TG_VK(vkQueueSubmit(device_.queue, 1, &submit, fence_));
}

bool Commands::finish(std::uint64_t nanoseconds) {
  const VkResult waited = vkWaitForFences(device_.device, 1, &fence_, VK_TRUE, nanoseconds);
  if (waited == VK_TIMEOUT) return false;
  TG_VK(waited);
  TG_VK(vkResetFences(device_.device, 1, &fence_));
  return true;
}

void stageBarrier(VkCommandBuffer commands, VkPipelineStageFlags before, VkPipelineStageFlags after) {
  VkMemoryBarrier barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER};
  barrier.srcAccessMask = accessOf(before, true);
  barrier.dstAccessMask = accessOf(after, false);
  vkCmdPipelineBarrier(commands, before, after, 0, 1, &barrier, 0, nullptr, 0, nullptr);
}

void upload(const VulkanDevice& device, Commands& commands, const Buffer& target, VkDeviceSize bytes,
            VkDeviceSize granularity, const std::function<void(VkDeviceSize first, std::span<std::byte>)>& write) {
  TG_ASSERT(granularity > 0 && bytes % granularity == 0, "whole grains are uploaded");
  TG_ASSERT(bytes <= target.size(), "the buffer has room");
  const VkDeviceSize piece = std::min(bytes, std::max(kStagingBytes / granularity, VkDeviceSize{1}) * granularity);
  if (piece == 0) return;
  const Buffer staging(device, "staging", piece, Memory::host);
  for (VkDeviceSize first = 0; first < bytes; first += piece) {
    const VkDeviceSize length = std::min(piece, bytes - first);
    write(first, {staging.data(), static_cast<std::size_t>(length)});
    commands.run([&](VkCommandBuffer buffer) {
      const VkBufferCopy copy{0, first, length};
      vkCmdCopyBuffer(buffer, staging.handle(), target.handle(), 1, &copy);
    });
  }
}

void download(const VulkanDevice& device, Commands& commands, const Buffer& source, std::span<std::byte> out) {
  TG_ASSERT(out.size() <= source.size(), "the buffer holds as much");
  if (out.empty()) return;
  const Buffer staging(device, "read-back", out.size(), Memory::readBack);
  commands.run([&](VkCommandBuffer buffer) {
    stageBarrier(buffer, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT,
                 VK_PIPELINE_STAGE_TRANSFER_BIT);
    const VkBufferCopy copy{0, 0, out.size()};
    vkCmdCopyBuffer(buffer, source.handle(), staging.handle(), 1, &copy);
    stageBarrier(buffer, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT);
  });
  std::memcpy(out.data(), staging.data(), out.size());
}

}  // namespace tg
