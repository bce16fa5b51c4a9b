// SPDX-License-Identifier: Apache-2.0
// The Vulkan renderer: keeps the buffers that the next frame needs, records it, reads it back.
#include <algorithm>
#include <cstring>

#include "core/error.h"
#include "render/vulkan/check.h"
#include "render/vulkan/frame.h"
#include "shared/layout.h"

namespace tg {
namespace {

constexpr std::uint32_t kFirstPairCapacity = 1u << 16;
constexpr std::uint32_t kFirstPairsPerGaussian = 4;

ViewUniforms viewOf(const Camera& camera, const RenderSettings& settings, const ModelBuffers& model,
                    const ImageBuffers& image) {
  ViewUniforms view{};
  glm::dmat4 camera_from_world(camera.camera_from_world_rotation);
  camera_from_world[3] = glm::dvec4(camera.camera_from_world_translation, 1.0);
  view.camera_from_world = glm::mat4(camera_from_world);
  view.camera_position = glm::vec4(glm::vec3(camera.position()), 0.0f);
  view.focal_center = glm::vec4(camera.fx, camera.fy, camera.cx, camera.cy);
  view.background = glm::vec4(settings.background, 0.0f);
  view.width = image.width;
  view.height = image.height;
  view.tiles_x = image.tilesX();
  view.tiles_y = image.tilesY();
  view.gaussian_count = model.gaussian_count;
  view.sh_degree = model.sh_degree;
  view.texture_mode = static_cast<std::uint32_t>(model.texture_mode) & static_cast<std::uint32_t>(settings.textures);
  view.intersection = static_cast<std::uint32_t>(settings.intersection.value_or(model.intersection));
  return view;
}

class RendererImpl final : public VulkanRenderer {
 public:
  RendererImpl(VulkanDevice& device, const VulkanTuning& tuning)
      : device_(device),
        tuning_(tuning),
        commands_(device),
        pipelines_(device),
        timer_(device),
        scratch_(device),
        view_(device, "view uniforms", sizeof(ViewUniforms), Memory::host),
        counters_(device, "counters", sizeof(Counters)),
        counters_read_(device, "counters read-back", sizeof(Counters), Memory::host) {}

  void setModel(const GaussianModel& model) override {
    passes_.reset();
    splats_.reset();
    model_.reset();
    model_ = uploadModel(device_, commands_, model);
    splats_.emplace(device_, model_->gaussian_count);
    const std::uint64_t wish = std::max<std::uint64_t>(kFirstPairCapacity, kFirstPairsPerGaussian * model.size());
    makePairs(static_cast<std::uint32_t>(std::min<std::uint64_t>(wish, maxPairCapacity(device_))));
  }

  Frame render(const Camera& camera, const RenderSettings& settings) override {
    do {
      prepare(camera, settings, {});
      commands_.run([&](VkCommandBuffer commands) { recordFrame(commands); });
    } while (!finishFrame());
    return readFrame();
  }

  void record(VkCommandBuffer commands, const VulkanFrameRequest& request) override {
    prepare(request.camera, request.settings, request.output);
    recordFrame(commands);
  }

  VkImage image() const override { return image_ ? image_->picture.handle() : VK_NULL_HANDLE; }

  bool finishFrame() override {
    times_ = timer_.read();
    Counters counters;
    std::memcpy(&counters, counters_read_.data(), sizeof counters);
    const std::uint32_t pairs = counters.work[kWorkPairs].total;
    counts_ = {counters.work[kWorkVisible].total, pairs};
    if (pairs <= pairs_->capacity) return blendedAll(counters.longest_list);
    const std::uint32_t most = maxPairCapacity(device_);
    if (pairs > most) {
      throw Error(ErrorKind::device, device_.properties.deviceName,
                  "the view needs " + (pairs == ~0u ? "over 4294967294" : std::to_string(pairs)) +
                      " pairs of tile and splat (expected at most " + std::to_string(most) + ")");
    }
    makePairs(static_cast<std::uint32_t>(std::min<std::uint64_t>(std::uint64_t{pairs} + pairs / 4, most)));
    return false;
  }

  VulkanFrameCounts counts() const override { return counts_; }
  const VulkanDevice& device() const override { return device_; }
  std::vector<PassTime> passTimes() const override { return times_; }
  std::string deviceName() const override { return device_.properties.deviceName; }

 private:
  void makePairs(std::uint32_t capacity) {
    passes_.reset();
    pairs_.reset();  // the old ones make room for the new ones
    pairs_.emplace(device_, capacity);
  }

  // False: a tile's list went on after the last dispatch of blend. The next frame has enough of them.
  bool blendedAll(std::uint32_t longest_list) {
    const std::uint32_t rounds = std::max(longest_list, 1u) / listEntriesPerRound(tuning_) + 1;
    if (rounds <= blend_rounds_) return true;
    blend_rounds_ = rounds;
    passes_.reset();
    return false;
  }

  FrameInputs inputs() const {
    return {tuning_, device_, *model_, *splats_, *pairs_, *image_, scratch_, shown_, textured_, blend_rounds_};
  }

  // Buffers, passes and uniforms of the next frame.
  void prepare(const Camera& camera, const RenderSettings& settings, std::optional<Output> shown) {
    if (!pairs_) throw Error(ErrorKind::usage, "a frame needs a model: setModel() comes first");
    checkSettings(settings);
    requireBlendingDefaults(settings, kBlendedOutputs, "the Vulkan renderer");
    if (camera.width <= 0 || camera.height <= 0) {
      throw Error(ErrorKind::usage, "camera \"" + camera.name + "\"",
                  "the image is empty (" + std::to_string(camera.width) + " x " + std::to_string(camera.height) + ")");
    }
    const auto width = static_cast<std::uint32_t>(camera.width);
    const auto height = static_cast<std::uint32_t>(camera.height);
    if (!image_ || image_->width != width || image_->height != height) {
      passes_.reset();
      image_.reset();
      image_.emplace(device_, width, height);
    }
    const ViewUniforms view = viewOf(camera, settings, *model_, *image_);
    const bool textured = model_->textured && view.texture_mode != kModeNone;
    if (shown != shown_ || textured != textured_) passes_.reset();
    shown_ = shown;
    textured_ = textured;
    if (!passes_) {
      passes_.emplace(device_, pipelines_, view_, counters_);
      buildFrame(*passes_, inputs());
    }
    std::memcpy(view_.data(), &view, sizeof view);
  }

  void recordFrame(VkCommandBuffer commands) {
    timer_.begin(commands);
    if (shown_) recordPictureStart(commands);
    recordFrameStart(commands, inputs(), counters_);
    passes_->record(commands, &timer_);
    const VkBufferCopy copy{0, 0, sizeof(Counters)};
    stageBarrier(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT);
    vkCmdCopyBuffer(commands, counters_.handle(), counters_read_.handle(), 1, &copy);
    stageBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT);
  }

  // Every pixel is written, so that the old picture need not survive the change of layout.
  void recordPictureStart(VkCommandBuffer commands) {
    VkImageMemoryBarrier barrier{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER};
    barrier.dstAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
    barrier.oldLayout = VK_IMAGE_LAYOUT_UNDEFINED;
    barrier.newLayout = VK_IMAGE_LAYOUT_GENERAL;
    barrier.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.image = image_->picture.handle();
    barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0, 0, nullptr,
                         0, nullptr, 1, &barrier);
  }

  Frame readFrame() {
    Frame frame(static_cast<int>(image_->width), static_cast<int>(image_->height));
    std::vector<glm::vec4> pixels(frame.base.size());
    const std::span<std::byte> bytes = std::as_writable_bytes(std::span(pixels));
    download(device_, commands_, image_->base_transmittance, bytes);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      frame.base[i] = glm::vec3(pixels[i]);
      frame.alpha[i] = 1.0f - pixels[i].w;
    }
    download(device_, commands_, image_->texture_depth, bytes);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      frame.texture[i] = glm::vec3(pixels[i]);
      frame.depth[i] = pixels[i].w;
    }
    download(device_, commands_, image_->normal_count, bytes);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      frame.normal[i] = glm::vec3(pixels[i]);
      frame.count[i] = pixels[i].w;
    }
    return frame;
  }

  VulkanDevice& device_;
  VulkanTuning tuning_;
  Commands commands_;
  Pipelines pipelines_;
  Timer timer_;
  Scratch scratch_;
  Buffer view_;
  Buffer counters_;
  Buffer counters_read_;
  std::optional<ModelBuffers> model_;
  std::optional<SplatBuffers> splats_;
  std::optional<PairBuffers> pairs_;
  std::optional<ImageBuffers> image_;
  std::optional<Output> shown_;
  bool textured_ = false;
  std::uint32_t blend_rounds_ = 1;
  std::optional<PassList> passes_;  // of the buffers above, which it outlives in no case
  std::vector<PassTime> times_;
  VulkanFrameCounts counts_;
};

}  // namespace

VulkanTuning tuningFor(const VulkanDevice& device) {
  const bool cpu = device.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
  return {cpu, cpu, 4};
}

std::unique_ptr<VulkanRenderer> makeVulkanRenderer(VulkanDevice& device) {
  return std::make_unique<RendererImpl>(device, tuningFor(device));
}

std::unique_ptr<VulkanRenderer> makeVulkanRenderer(VulkanDevice& device, const VulkanTuning& tuning) {
  return std::make_unique<RendererImpl>(device, tuning);
}

}  // namespace tg
