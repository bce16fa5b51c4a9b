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

VkBufferImageCopy wholeCopy(glm::ivec2 size) {
  VkBufferImageCopy copy{};
  copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  copy.imageExtent = {static_cast<std::uint32_t>(size.x), static_cast<std::uint32_t>(size.y), 1};
  return copy;
}

bool sameView(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
         a.camera_from_world_rotation == b.camera_from_world_rotation &&
         a.camera_from_world_translation == b.camera_from_world_translation;
}

bool sameOther(const OtherPicture& a, const OtherPicture& b) {
  if (a.model != b.model || a.difference != b.difference) return false;
  if (!a.model && (a.photograph != b.photograph || !sameView(a.taken, b.taken))) return false;
  return !a.difference || (a.with_sign == b.with_sign && a.gain == b.gain);
}

}  // namespace

bool same(const PictureRequest& a, const PictureRequest& b) {
  if (a.other.has_value() != b.other.has_value() || (a.other && !sameOther(*a.other, *b.other))) return false;
  return a.model == b.model && sameView(a.camera, b.camera) && a.settings == b.settings && a.output == b.output &&
         a.exposure == b.exposure;
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
  fresh.renderer->setModel(model);
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
  Picture picture;
  picture.request = request;
  const auto pair = request.other ? std::make_shared<PicturePair>() : nullptr;
  Loaded& model = loaded(request.model);
  const std::shared_ptr<PictureImage> image = freeImage({request.camera.width, request.camera.height});
  drawModel(model, request, *image, pair ? &pair->first : nullptr);
  picture.image = image;
  picture.passes = model.renderer->passTimes();
  picture.device = model.renderer->deviceName();
  if (pair) {
    drawOther(request, picture, *pair);
    if (picture.other) picture.pair = pair;
  }
  picture.milliseconds = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return picture;
}

void PictureMaker::drawOther(const PictureRequest& request, Picture& picture, PicturePair& pair) {
  const OtherPicture& other = *request.other;
  const glm::ivec2 size(request.camera.width, request.camera.height);
  const std::shared_ptr<PictureImage> image = freeImage(size);
  if (other.model) {
    drawModel(loaded(other.model), request, *image, &pair.other);
  } else {
    if (photograph_path_ != other.photograph) {
      photograph_path_.clear();
      try {
        photograph_ = readImage(other.photograph);
      } catch (const Error& error) {
        picture.problem = error.what();
        return;
      }
      photograph_path_ = other.photograph;
    }
    ResampledPhotograph seen = resampled(photograph_, other.taken, request.camera, request.settings.background);
    pair.other = std::move(seen.image);
    pair.mask = std::move(seen.mask);
    upload(pair.other, *image);
  }
  picture.other = image;
  if (!other.difference) return;
  const std::shared_ptr<PictureImage> difference = freeImage(size);
  upload(differenceOf(pair.first, pair.other, pair.mask, {.gain = other.gain, .with_sign = other.with_sign}),
         *difference);
  picture.difference = difference;
}

void PictureMaker::drawModel(Loaded& loaded, const PictureRequest& request, const PictureImage& target, Image* pixels) {
  if (loaded.vulkan) {
    drawVulkan(loaded, request, target);
    if (pixels) *pixels = download(target);
    return;
  }
  RenderSettings settings = request.settings;
  settings.outputs = {request.output};
  Image picture = visualize(loaded.renderer->render(request.camera, settings), request.output, request.exposure);
  upload(picture, target);
  if (pixels) *pixels = std::move(picture);
}

void PictureMaker::drawVulkan(Loaded& loaded, const PictureRequest& request, const PictureImage& target) {
  bool complete = false;
  for (int attempt = 0; !complete && attempt < kMaxGrowth; ++attempt) {
    commands_.run([&](VkCommandBuffer commands) {
      loaded.vulkan->record(commands, {request.camera, request.settings, request.output, request.exposure});
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

std::byte* PictureMaker::staging(glm::ivec2 size) {
  const VkDeviceSize bytes = VkDeviceSize{4} * size.x * size.y;
  if (staging_.size() < bytes) {
    staging_ = {};  // the old one makes room
    staging_ = Buffer(device_, "a picture on its way", bytes, Memory::host);
  }
  return staging_.data();
}

void PictureMaker::upload(const Image& picture, const PictureImage& target) {
  auto* out = reinterpret_cast<std::uint8_t*>(staging(target.size));
  parallelFor(picture.height, 16, [&](std::int64_t y) {
    const std::size_t row = static_cast<std::size_t>(y) * picture.width;
    for (std::size_t i = row; i < row + picture.width; ++i) {
      for (int c = 0; c < 3; ++c) out[i * 4 + c] = static_cast<std::uint8_t>(picture.data[i * 3 + c] * 255.0f + 0.5f);
      out[i * 4 + 3] = 255;
    }
  });
  commands_.run([&](VkCommandBuffer commands) {
    beginWrite(commands, target.storage.handle());
    const VkBufferImageCopy copy = wholeCopy(target.size);
    vkCmdCopyBufferToImage(commands, staging_.handle(), target.storage.handle(), VK_IMAGE_LAYOUT_GENERAL, 1, &copy);
  });
}

Image PictureMaker::download(const PictureImage& source) {
  const std::byte* bytes = staging(source.size);
  commands_.run([&](VkCommandBuffer commands) {
    barrier(commands, source.storage.handle(), VK_IMAGE_LAYOUT_GENERAL, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT,
            VK_IMAGE_LAYOUT_GENERAL, kTransfer, VK_ACCESS_TRANSFER_READ_BIT);
    const VkBufferImageCopy copy = wholeCopy(source.size);
    vkCmdCopyImageToBuffer(commands, source.storage.handle(), VK_IMAGE_LAYOUT_GENERAL, staging_.handle(), 1, &copy);
    stageBarrier(commands, kTransfer, VK_PIPELINE_STAGE_HOST_BIT);
  });
  return imageFromRgba8({bytes, std::size_t{4} * source.size.x * source.size.y}, source.size.x, source.size.y);
}

}  // namespace tg
