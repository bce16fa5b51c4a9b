// SPDX-License-Identifier: Apache-2.0
// The Vulkan renderer: keeps the buffers that the next frame needs, records it, reads it back.
#include <algorithm>
#include <cmath>
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
                    const ImageBuffers& image, float exposure_stops) {
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
  const CropBox crop = settings.crop.value_or(CropBox{});
  view.crop_min = glm::vec4(crop.min, settings.crop ? 1.0f : 0.0f);
  view.crop_max = glm::vec4(crop.max, 0.0f);
  view.opacity_scale = settings.opacity_scale;
  view.splat_scale = settings.splat_scale;
  view.near = settings.near;
  view.exposure = std::exp2(exposure_stops);
  view.sh_used = std::min(model.sh_degree, static_cast<std::uint32_t>(settings.max_sh_degree));
  view.antialiasing = settings.antialiasing == Antialiasing::screen;
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

  using Renderer::setModel;
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
    constexpr OutputSet kSolid = {Output::ellipsoids, Output::centers};
    FrameVariant variant = variantFor(settings.outputs);
    OutputSet outputs = settings.outputs;
    if (variant.all) outputs = outputs | kBlendedOutputs | OutputSet{Output::depthMedian, Output::texelDensity};
    if (outputs.has(Output::final)) outputs = outputs | OutputSet{Output::alpha};
    checkFrame(camera, settings);
    fitImage(camera);
    Frame frame(camera.width, camera.height, outputs);
    if (variant.all || outputs.hasAny({Output::final, Output::alpha}) || !outputs.hasAny(kSolid)) {
      draw(camera, settings, variant);
      readBlended(variant, frame);
    }
    for (const Output solid : {Output::ellipsoids, Output::centers}) {
      if (!outputs.has(solid)) continue;
      variant = variantFor(solid);
      variant.shown.reset();
      draw(camera, settings, variant);
      std::vector<glm::vec3>& colors = solid == Output::ellipsoids ? frame.ellipsoids : frame.centers;
      const std::vector<glm::vec4> pixels = readPixels(image_->base_transmittance);
      colors.assign(pixels.begin(), pixels.end());
    }
    return frame;
  }

  void record(VkCommandBuffer commands, const VulkanFrameRequest& request) override {
    checkFrame(request.camera, request.settings);
    prepare(request.camera, request.settings, variantFor(request.output), request.exposure_stops);
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
    return {tuning_, device_, *model_, *splats_, *pairs_, *image_, scratch_, variant_, blend_rounds_};
  }

  void checkFrame(const Camera& camera, const RenderSettings& settings) const {
    if (!pairs_) throw Error(ErrorKind::usage, "a frame needs a model whose buffers fit: setModel() comes first");
    checkSettings(settings);
    if (camera.width <= 0 || camera.height <= 0) {
      throw Error(ErrorKind::usage, "camera \"" + camera.name + "\"",
                  "the image is empty (" + std::to_string(camera.width) + " x " + std::to_string(camera.height) + ")");
    }
  }

  void draw(const Camera& camera, const RenderSettings& settings, const FrameVariant& variant) {
    do {
      prepare(camera, settings, variant, 0.0f);
      commands_.run([&](VkCommandBuffer commands) { recordFrame(commands); });
    } while (!finishFrame());
  }

  void fitImage(const Camera& camera) {
    const auto width = static_cast<std::uint32_t>(camera.width);
    const auto height = static_cast<std::uint32_t>(camera.height);
    if (!image_ || image_->width != width || image_->height != height) {
      passes_.reset();
      image_.reset();
      image_.emplace(device_, width, height);
    }
  }

  // Buffers, passes and uniforms of the next frame.
  void prepare(const Camera& camera, const RenderSettings& settings, FrameVariant variant, float exposure_stops) {
    fitImage(camera);
    const ViewUniforms view = viewOf(camera, settings, *model_, *image_, exposure_stops);
    if (model_->textured && view.texture_mode != kModeNone) {
      variant.sample = settings.texture_filter == TextureFilter::footprint ? kSampleFootprint : kSampleBilinear;
    }
    variant.per_pixel = settings.order == SplatOrder::perPixel;
    if (variant != variant_) passes_.reset();
    variant_ = variant;
    if (!passes_) {
      passes_.emplace(device_, pipelines_, view_, counters_);
      buildFrame(*passes_, inputs());
    }
    std::memcpy(view_.data(), &view, sizeof view);
  }

  void recordFrame(VkCommandBuffer commands) {
    timer_.begin(commands);
    if (variant_.shown) recordPictureStart(commands);
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

  std::vector<glm::vec4> readPixels(const Buffer& buffer) {
    std::vector<glm::vec4> pixels(std::size_t{image_->width} * image_->height);
    download(device_, commands_, buffer, std::as_writable_bytes(std::span(pixels)));
    return pixels;
  }

  // Into the members that the frame holds.
  void readBlended(const FrameVariant& variant, Frame& frame) {
    const auto put = [](auto& out, std::size_t i, auto value) {
      if (!out.empty()) out[i] = value;
    };
    std::vector<glm::vec4> pixels = readPixels(image_->base_transmittance);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      put(frame.picture, i, glm::vec3(pixels[i]));
      put(frame.base, i, glm::vec3(pixels[i]));
      put(frame.alpha, i, 1.0f - pixels[i].w);
    }
    if (!variant.all) return;
    pixels = readPixels(image_->texture_depth);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      frame.texture[i] = glm::vec3(pixels[i]);
      frame.depth[i] = pixels[i].w;
    }
    pixels = readPixels(image_->normal_count);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      frame.normal[i] = glm::vec3(pixels[i]);
      frame.count[i] = pixels[i].w;
    }
    pixels = readPixels(image_->extras);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      frame.depth_median[i] = pixels[i].x;
      put(frame.overdraw, i, pixels[i].y);
      frame.texel_density[i] = pixels[i].z;
    }
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
  FrameVariant variant_;
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
