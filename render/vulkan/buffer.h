// SPDX-License-Identifier: Apache-2.0
// Buffers, the picture and the way from and to the host. One allocation each: a frame has about thirty.
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "render/gpu/device.h"
#include "render/vulkan/vulkan_device.h"

namespace tg {

enum class Memory { device, host, readBack };  // the host's: mapped and coherent, for uniforms and transfers

class Buffer final : public GpuBuffer {
 public:
  Buffer() = default;
  Buffer(const VulkanDevice& device, const char* name, VkDeviceSize bytes, Memory memory = Memory::device);
  Buffer(Buffer&& other) noexcept { swap(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Buffer() override;

  VkBuffer handle() const { return buffer_; }
  VkDeviceSize size() const { return size_; }  // [bytes] of it that passes are shown; more may be allocated
  std::byte* data() const { return data_; }    // not of Memory::device
  // As a uniform texel buffer; made at the first call for a format. Throws Error(device) when it has more
  // elements than the device can bind.
  VkBufferView view(VkFormat format) const;

 private:
  void swap(Buffer& other) noexcept;

  const VulkanDevice* device_ = nullptr;
  const char* name_ = "";
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  VkDeviceSize size_ = 0;
  std::byte* data_ = nullptr;
  mutable std::vector<std::pair<VkFormat, VkBufferView>> views_;
};

// The RGBA8 picture that a window copies from.
class StorageImage final : public GpuImage {
 public:
  StorageImage() = default;
  StorageImage(const VulkanDevice& device, std::uint32_t width, std::uint32_t height);
  StorageImage(StorageImage&& other) noexcept { swap(other); }
  StorageImage& operator=(StorageImage&& other) noexcept {
    swap(other);
    return *this;
  }
  ~StorageImage() override;

  VkImage handle() const { return image_; }
  VkImageView view() const { return view_; }

 private:
  void swap(StorageImage& other) noexcept;

  VkDevice device_ = VK_NULL_HANDLE;
  VkImage image_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  VkImageView view_ = VK_NULL_HANDLE;
};

// One command buffer with its fence, for work that the host waits for.
class Commands {
 public:
  explicit Commands(const VulkanDevice& device);
  Commands& operator=(Commands&&) = delete;
  ~Commands();

  // Records, submits and waits.
  void run(const std::function<void(VkCommandBuffer)>& record);
  // The same in two steps. finish() waits at most so long [ns]; false: it has not ended.
  void start(const std::function<void(VkCommandBuffer)>& record);
  bool finish(std::uint64_t nanoseconds = UINT64_MAX);

 private:
  const VulkanDevice& device_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkFence fence_ = VK_NULL_HANDLE;
};

// Makes what `before` wrote visible to `after`. Stages that transfer, compute, read arguments or read on the host.
void stageBarrier(VkCommandBuffer commands, VkPipelineStageFlags before, VkPipelineStageFlags after);

// Fills `target` from offset 0 through a staging buffer of bounded size: write(first_byte, staging) delivers the next
// piece, whose length is a multiple of `granularity`.
void upload(const VulkanDevice& device, Commands& commands, const Buffer& target, VkDeviceSize bytes,
            VkDeviceSize granularity, const std::function<void(VkDeviceSize first, std::span<std::byte>)>& write);

// Reads back `bytes` from offset 0 into `out`.
void download(const VulkanDevice& device, Commands& commands, const Buffer& source, std::span<std::byte> out);

}  // namespace tg
