// SPDX-License-Identifier: Apache-2.0
// Renderers per model, and the images that leave for the window.
#include "viewer/picture_maker.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"

namespace tg {
namespace {

constexpr std::size_t kModelsAtOnce = 2;  // on the device: the one shown, and one to compare with or to go back to
constexpr int kMaxGrowth = 8;             // repeats of a frame whose buffers were too small

// Makes writes of `before` visible to `after` on the whole image and changes its layout.
void barrier(VkCommandBuffer commands, VkImage image, VkImageLayout old_layout, VkPipelineStageFlags before,
             VkAccessFlags written, VkImageLayout new_layout, VkPipelineStageFlags after, VkAccessFlags used) {
  VkImageMemoryBarrier info{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER};
  info.srcAccessMask = written;
  info.dstAccessMask = used;
  info.oldLayout = old_layout;
  info.newLayout = new_layout;
  info.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  info.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  info.image = image;
  info.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
  vkCmdPipelineBarrier(commands, before, after, 0, 0, nullptr, 0, nullptr, 1, &info);
}

constexpr VkPipelineStageFlags kTransfer = VK_PIPELINE_STAGE_TRANSFER_BIT;

// The old contents may go.
void beginWrite(VkCommandBuffer commands, VkImage image) {
  barrier(commands, image, VK_IMAGE_LAYOUT_UNDEFINED, kTransfer, 0, VK_IMAGE_LAYOUT_GENERAL, kTransfer,
          VK_ACCESS_TRANSFER_WRITE_BIT);
}

bool sameView(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
         a.camera_from_world_rotation == b.camera_from_world_rotation &&
         a.camera_from_world_translation == b.camera_from_world_translation;
}

}  // namespace

bool same(const PictureRequest& a, const PictureRequest& b) {
  return a.model == b.model && sameView(a.camera, b.camera) && a.settings == b.settings && a.output == b.output;
}

struct PictureMaker::Loaded {
  std::shared_ptr<const GaussianModel> model;
  std::unique_ptr<Renderer> renderer;
  VulkanRenderer* vulkan = nullptr;  // the same, where it is one
};

PictureMaker::PictureMaker(VulkanDevice& device, bool cpu) : device_(device), cpu_(cpu), commands_(device) {}
PictureMaker::~PictureMaker() = default;

PictureMaker::Loaded& PictureMaker::loaded(const std::shared_ptr<const GaussianModel>& model) {
  const auto found = std::find_if(loaded_.begin(), loaded_.end(), [&](const Loaded& l) { return l.model == model; });
  if (found != loaded_.end()) {
    loaded_.splice(loaded_.begin(), loaded_, found);
    return loaded_.front();
  }
  // Models that are no longer open, then the one unused for longest, make room first.
  std::erase_if(loaded_, [](const Loaded& l) { return l.model.use_count() == 1; });
  while (loaded_.size() >= kModelsAtOnce) loaded_.pop_back();
  Loaded fresh;
  fresh.model = model;
  if (cpu_) {
    fresh.renderer = makeCpuRenderer();
  } else {
    std::unique_ptr<VulkanRenderer> vulkan = makeVulkanRenderer(device_);
    fresh.vulkan = vulkan.get();
    fresh.renderer = std::move(vulkan);
  }
  fresh.renderer->setModel(*model);
  return loaded_.emplace_front(std::move(fresh));
}

std::shared_ptr<PictureImage> PictureMaker::freeImage(glm::ivec2 size) {
  const auto unused = [](const std::shared_ptr<PictureImage>& image) { return image.use_count() == 1; };
  std::erase_if(images_, [&](const auto& image) { return unused(image) && image->size != size; });
  const auto found = std::find_if(images_.begin(), images_.end(), unused);
  // The window's last use of the image came before it let go of it.
  std::atomic_thread_fence(std::memory_order_acquire);
  return found != images_.end() ? *found : images_.emplace_back(std::make_shared<PictureImage>(device_, size));
}

Picture PictureMaker::draw(const PictureRequest& request) {
  const auto start = std::chrono::steady_clock::now();
  Loaded& model = loaded(request.model);
  const std::shared_ptr<PictureImage> image = freeImage({request.camera.width, request.camera.height});
  if (model.vulkan)
    drawVulkan(model, request, *image);
  else
    drawCpu(model, request, *image);
  Picture picture;
  picture.request = request;
  picture.image = image;
  picture.passes = model.renderer->passTimes();
  picture.device = model.renderer->deviceName();
  picture.milliseconds = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return picture;
}

void PictureMaker::drawVulkan(Loaded& loaded, const PictureRequest& request, const PictureImage& target) {
  bool complete = false;
  for (int attempt = 0; !complete && attempt < kMaxGrowth; ++attempt) {
    commands_.run([&](VkCommandBuffer commands) {
      loaded.vulkan->record(commands, {request.camera, request.settings, request.output});
      const VkImage drawn = loaded.vulkan->image();
      barrier(commands, drawn, VK_IMAGE_LAYOUT_GENERAL, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
              VK_ACCESS_SHADER_WRITE_BIT, VK_IMAGE_LAYOUT_GENERAL, kTransfer, VK_ACCESS_TRANSFER_READ_BIT);
      beginWrite(commands, target.storage.handle());
      VkImageCopy copy{};
      copy.srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
      copy.dstSubresource = copy.srcSubresource;
      copy.extent = {static_cast<std::uint32_t>(target.size.x), static_cast<std::uint32_t>(target.size.y), 1};
      vkCmdCopyImage(commands, drawn, VK_IMAGE_LAYOUT_GENERAL, target.storage.handle(), VK_IMAGE_LAYOUT_GENERAL, 1,
                     &copy);
    });
    complete = loaded.vulkan->finishFrame();
  }
  if (!complete) throw Error(ErrorKind::device, "a frame does not fit the device's buffers however often they grow");
}

void PictureMaker::drawCpu(Loaded& loaded, const PictureRequest& request, const PictureImage& target) {
  RenderSettings settings = request.settings;
  settings.outputs = {request.output};
  const Image picture = visualize(loaded.renderer->render(request.camera, settings), request.output);
  const VkDeviceSize bytes = VkDeviceSize{4} * picture.width * picture.height;
  if (staging_.size() < bytes) {
    staging_ = {};  // the old one makes room
    staging_ = Buffer(device_, "the CPU's picture", bytes, Memory::host);
  }
  auto* out = reinterpret_cast<std::uint8_t*>(staging_.data());
  parallelFor(picture.height, 16, [&](std::int64_t y) {
    const std::size_t row = static_cast<std::size_t>(y) * picture.width;
    for (std::size_t i = row; i < row + picture.width; ++i) {
      for (int c = 0; c < 3; ++c) out[i * 4 + c] = static_cast<std::uint8_t>(picture.data[i * 3 + c] * 255.0f + 0.5f);
      out[i * 4 + 3] = 255;
    }
  });
  commands_.run([&](VkCommandBuffer commands) {
    beginWrite(commands, target.storage.handle());
    VkBufferImageCopy copy{};
    copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    copy.imageExtent = {static_cast<std::uint32_t>(target.size.x), static_cast<std::uint32_t>(target.size.y), 1};
    vkCmdCopyBufferToImage(commands, staging_.handle(), target.storage.handle(), VK_IMAGE_LAYOUT_GENERAL, 1, &copy);
  });
}

}  // namespace tg
