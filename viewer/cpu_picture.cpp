// SPDX-License-Identifier: Apache-2.0
// CPU frames as a Vulkan image.
#include "viewer/cpu_picture.h"

#include "core/parallel.h"
#include "render/vulkan/buffer.h"

namespace tg {
namespace {

class CpuPictureRenderer final : public VulkanRenderer {
 public:
  explicit CpuPictureRenderer(VulkanDevice& device) : device_(device), cpu_(makeCpuRenderer()) {}

  void setModel(const GaussianModel& model) override { cpu_->setModel(model); }
  Frame render(const Camera& camera, const RenderSettings& settings) override { return cpu_->render(camera, settings); }
  std::vector<PassTime> passTimes() const override { return cpu_->passTimes(); }
  std::string deviceName() const override { return cpu_->deviceName(); }
  VkImage image() const override { return image_.handle(); }
  bool finishFrame() override { return true; }
  const VulkanDevice& device() const override { return device_; }

  void record(VkCommandBuffer commands, const VulkanFrameRequest& request) override {
    const Image picture = visualize(cpu_->render(request.camera, request.settings), request.output);
    resize(picture.width, picture.height);
    auto* bytes = reinterpret_cast<std::uint8_t*>(staging_.data());
    parallelFor(picture.height, 16, [&](std::int64_t y) {
      const std::size_t row = static_cast<std::size_t>(y) * picture.width;
      for (std::size_t i = row; i < row + picture.width; ++i) {
        for (int c = 0; c < 3; ++c)
          bytes[i * 4 + c] = static_cast<std::uint8_t>(picture.data[i * 3 + c] * 255.0f + 0.5f);
        bytes[i * 4 + 3] = 255;
      }
    });
    recordCopy(commands);
  }

 private:
  void resize(int width, int height) {
    if (width == width_ && height == height_) return;
    image_ = StorageImage(device_, width, height);
    staging_ = Buffer(device_, "the CPU's picture", VkDeviceSize{4} * width * height, Memory::host);
    width_ = width;
    height_ = height;
  }

  void recordCopy(VkCommandBuffer commands) {
    VkImageMemoryBarrier barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER};
    barrier.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
    barrier.oldLayout = VK_IMAGE_LAYOUT_UNDEFINED;
    barrier.newLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
    barrier.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.image = image_.handle();
    barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0, nullptr, 0,
                         nullptr, 1, &barrier);
    VkBufferImageCopy copy{};
    copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    copy.imageExtent = {static_cast<std::uint32_t>(width_), static_cast<std::uint32_t>(height_), 1};
    vkCmdCopyBufferToImage(commands, staging_.handle(), image_.handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1,
                           &copy);
    barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
    barrier.dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
    barrier.oldLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
    barrier.newLayout = VK_IMAGE_LAYOUT_GENERAL;
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0, nullptr, 0,
                         nullptr, 1, &barrier);
  }

  VulkanDevice& device_;
  std::unique_ptr<Renderer> cpu_;
  StorageImage image_;
  Buffer staging_;
  int width_ = 0;
  int height_ = 0;
};

}  // namespace

std::unique_ptr<VulkanRenderer> makeCpuPictureRenderer(VulkanDevice& device) {
  return std::make_unique<CpuPictureRenderer>(device);
}

}  // namespace tg
