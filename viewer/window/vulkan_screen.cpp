// SPDX-License-Identifier: Apache-2.0
// Windows on Vulkan.
#include <vulkan/vulkan.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_vulkan.h>
#include <imgui.h>

#include <algorithm>
#include <cstdint>
#include <deque>
#include <mutex>

#include "core/system/error.h"
#include "render/vulkan/buffer.h"
#include "render/vulkan/check.h"
#include "render/vulkan/vulkan_renderer.h"
#include "viewer/window/presenter.h"
#include "viewer/window/screen.h"

namespace tg {
namespace {

constexpr std::uint32_t kVertexBuffers = 2;  // of ImGui's back end, one to a frame in flight; it accepts no fewer
constexpr VkPipelineStageFlags kTransfer = VK_PIPELINE_STAGE_TRANSFER_BIT;

using DevicePtr = std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)>;

DevicePtr createWindowDevice(GLFWwindow* window, const ViewOptions& view, const DevicePick& pick) {
  VulkanOptions options;
  options.validation = view.validation;
  options.device = pick.name;
  options.index = pick.index;
  std::uint32_t count = 0;
  const char** extensions = glfwGetRequiredInstanceExtensions(&count);
  if (!extensions) throw Error(ErrorKind::device, "Vulkan cannot draw to this display");
  options.instance_extensions.assign(extensions, extensions + count);
  options.swapchain = true;
  options.surface = [window](VkInstance instance) {
    VkSurfaceKHR surface = VK_NULL_HANDLE;
    if (glfwCreateWindowSurface(instance, window, nullptr, &surface) != VK_SUCCESS) {
      const char* text = nullptr;
      glfwGetError(&text);
      throw Error(ErrorKind::device, std::string("Vulkan cannot draw to this window: ") + (text ? text : "no reason"));
    }
    return surface;
  };
  return createVulkanDevice(options);
}

// Layout GENERAL.
class VulkanPictureImage final : public PictureImage {
 public:
  VulkanPictureImage(const VulkanDevice& device, glm::ivec2 s)
      : PictureImage(s), storage(device, static_cast<std::uint32_t>(s.x), static_cast<std::uint32_t>(s.y)) {}
  StorageImage storage;
};

VkImage imageOf(const PictureImage& image) { return static_cast<const VulkanPictureImage&>(image).storage.handle(); }

constexpr ImageUse kWritten{kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, VK_IMAGE_LAYOUT_GENERAL};
constexpr ImageUse kRead{kTransfer, VK_ACCESS_TRANSFER_READ_BIT, VK_IMAGE_LAYOUT_GENERAL};

// The old contents may go.
void beginWrite(VkCommandBuffer commands, VkImage image) {
  imageBarrier(commands, image, {kTransfer, 0, VK_IMAGE_LAYOUT_UNDEFINED}, kWritten);
}

VkBufferImageCopy wholeCopy(glm::ivec2 size) {
  VkBufferImageCopy copy{};
  copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  copy.imageExtent = {static_cast<std::uint32_t>(size.x), static_cast<std::uint32_t>(size.y), 1};
  return copy;
}

class VulkanPictureDevice final : public PictureDevice {
 public:
  VulkanPictureDevice(VulkanDevice& device, int frames_in_flight) : device_(device), pipelines_(makePipelines(device)) {
    for (int i = 0; i < frames_in_flight; ++i) frames_.push_back(std::make_unique<Commands>(device));
  }
  VulkanPictureDevice& operator=(VulkanPictureDevice&&) = delete;
  ~VulkanPictureDevice() override { drain(); }

  std::shared_ptr<PictureImage> makeImage(glm::ivec2 size) override {
    return std::make_shared<VulkanPictureImage>(device_, size);
  }
  std::unique_ptr<GpuRenderer> makeRenderer() override { return makeVulkanRenderer(device_, pipelines_); }

  bool draw(GpuRenderer& renderer, const FrameRequest& request, PictureImage& target, int top) override {
    auto& vulkan = static_cast<VulkanRenderer&>(renderer);
    frames_[0]->run([&](VkCommandBuffer commands) { record(commands, vulkan, request, target, top); });
    return vulkan.finishFrame();
  }

  bool begin(GpuRenderer& renderer, const FrameRequest& request, const std::shared_ptr<PictureImage>& target) override {
    auto& vulkan = static_cast<VulkanRenderer&>(renderer);
    if (under_way_.size() == frames_.size()) return false;
    if (vulkan.rowsAtOnce(request.camera) < request.camera.size.y) return false;
    if (!under_way_.empty() && (under_way_.front().renderer != &vulkan || !vulkan.sharesProgram(request))) return false;
    Commands& commands = *frames_[begun_ % frames_.size()];
    commands.start([&](VkCommandBuffer buffer) { record(buffer, vulkan, request, *target, 0); });
    ++begun_;
    under_way_.push_back({&vulkan, &commands, target});
    return true;
  }

  std::optional<bool> finish(double milliseconds) override {
    const UnderWay oldest = under_way_.front();
    if (oldest.renderer) {
      const double most = 1e-6 * static_cast<double>(UINT64_MAX / 2);  // of the fence's clock
      if (!oldest.commands->finish(static_cast<std::uint64_t>(std::min(milliseconds, most) * 1e6))) return std::nullopt;
      under_way_.pop_front();
      if (oldest.renderer->frameFits()) return oldest.renderer->finishFrame();
      // Its buffers grow, so that nothing may use them; what was drawn with them counts for nothing.
      for (UnderWay& later : under_way_) {
        later.commands->finish();
        later.renderer = nullptr;
      }
      return oldest.renderer->finishFrame();
    }
    under_way_.pop_front();
    return false;
  }

  void drain() noexcept override {
    for (const UnderWay& frame : under_way_) {
      try {
        if (frame.renderer) frame.commands->finish();
      } catch (const Error&) {  // a lost device has nothing under way
      }
    }
    under_way_.clear();
  }

  void upload(const Image& picture, PictureImage& target) override {
    toRgba8(picture, staging(target.size));
    frames_[0]->run([&](VkCommandBuffer commands) {
      beginWrite(commands, imageOf(target));
      const VkBufferImageCopy copy = wholeCopy(target.size);
      vkCmdCopyBufferToImage(commands, staging_.handle(), imageOf(target), VK_IMAGE_LAYOUT_GENERAL, 1, &copy);
    });
  }

  Image download(const PictureImage& source) override {
    const std::span<std::byte> bytes = staging(source.size);
    frames_[0]->run([&](VkCommandBuffer commands) {
      imageBarrier(commands, imageOf(source), kWritten, kRead);
      const VkBufferImageCopy copy = wholeCopy(source.size);
      vkCmdCopyImageToBuffer(commands, imageOf(source), VK_IMAGE_LAYOUT_GENERAL, staging_.handle(), 1, &copy);
      stageBarrier(commands, kTransfer, VK_PIPELINE_STAGE_HOST_BIT);
    });
    return imageFromRgba8(bytes, source.size.x, source.size.y);
  }

 private:
  struct UnderWay {
    VulkanRenderer* renderer;  // null: it has ended, and must be drawn again
    Commands* commands;
    std::shared_ptr<PictureImage> target;
  };

  static void record(VkCommandBuffer commands, VulkanRenderer& vulkan, const FrameRequest& request,
                     const PictureImage& target, int top) {
    vulkan.record(commands, request);
    imageBarrier(commands, vulkan.image(),
                 {VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_WRITE_BIT, VK_IMAGE_LAYOUT_GENERAL}, kRead);
    if (top == 0) {
      beginWrite(commands, imageOf(target));
    } else {
      imageBarrier(commands, imageOf(target), kWritten, kWritten);
    }
    VkImageCopy copy{};
    copy.srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    copy.dstSubresource = copy.srcSubresource;
    copy.dstOffset = {0, top, 0};
    copy.extent = wholeCopy({target.size.x, request.camera.size.y}).imageExtent;
    vkCmdCopyImage(commands, vulkan.image(), VK_IMAGE_LAYOUT_GENERAL, imageOf(target), VK_IMAGE_LAYOUT_GENERAL, 1,
                   &copy);
  }

  std::span<std::byte> staging(glm::ivec2 size) {
    const std::size_t bytes = std::size_t{4} * size.x * size.y;
    if (staging_.size() < bytes) {
      staging_ = {};  // the old one makes room
      staging_ = Buffer(device_, "a picture on its way", bytes, Memory::host);
    }
    return {staging_.data(), bytes};
  }

  VulkanDevice& device_;
  std::shared_ptr<Pipelines> pipelines_;           // of all models: an edit makes a renderer anew
  std::vector<std::unique_ptr<Commands>> frames_;  // as many as may be under way
  std::size_t begun_ = 0;
  std::deque<UnderWay> under_way_;
  Buffer staging_;
};

void checkResult(VkResult result) { TG_VK(result); }

class VulkanScreen final : public Screen {
 public:
  VulkanScreen(GLFWwindow* window, const ViewOptions& options, const DevicePick& pick)
      : window_(window),
        device_(createWindowDevice(window, options, pick)),
        frames_in_flight_(options.frames_in_flight.value_or(device_->queue == device_->window_queue ? 1 : 2)),
        presenter_(*device_, frames_in_flight_) {}

  bool software() const override { return device_->properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU; }
  int framesInFlight() const override { return frames_in_flight_; }
  std::size_t messages() const override {
    const std::lock_guard lock(device_->messages_mutex);
    return device_->validation_messages.size();
  }
  std::unique_ptr<PictureDevice> makePictureDevice() override {
    return std::make_unique<VulkanPictureDevice>(*device_, frames_in_flight_);
  }

  glm::ivec2 size() const override { return presenter_.size(); }
  bool acquire(glm::ivec2 framebuffer_size) override { return presenter_.acquire(framebuffer_size); }
  void draw(std::span<const PictureBlit> pictures, glm::vec3 clear, bool panels) override {
    const VkCommandBuffer commands = presenter_.beginFrame();
    presenter_.recordPictures(pictures, imageOf, clear);
    presenter_.beginPanels();
    if (panels) {
      panels_broken_ = true;
      const auto lock = lockForUpload();
      ImGui_ImplVulkan_RenderDrawData(ImGui::GetDrawData(), commands);
      panels_broken_ = false;
    }
    presenter_.endPanels();
    presenter_.submit();
  }
  Image read(const PictureImage& image) override { return presenter_.read(imageOf(image), image.size); }
  Image readWindow() override { return presenter_.readWindow(); }
  void present() override { presenter_.present(); }

  void startPanels() override;
  void beginPanels() override {
    {
      const auto lock = lockForUpload();
      ImGui_ImplVulkan_NewFrame();
    }
    ImGui_ImplGlfw_NewFrame();
  }
  void stopPanels() override {
    presenter_.waitIdle();
    ImGuiIO& io = ImGui::GetIO();
    if (panels_broken_) {
      io.BackendRendererUserData = nullptr;  // the back end would destroy its buffers twice: what it holds stays
    } else if (io.BackendRendererUserData) {
      ImGui_ImplVulkan_Shutdown();
    }
    if (io.BackendPlatformUserData) ImGui_ImplGlfw_Shutdown();
    vkDestroyDescriptorPool(device_->device, pool_, nullptr);
    pool_ = VK_NULL_HANDLE;
  }

 private:
  // For as long as ImGui's back end may send something to the window's queue: since 1.90 it uploads the letters when
  // they are first needed, at the start of a frame or, since 1.92, while it draws.
  std::unique_lock<std::mutex> lockForUpload() const {
#if IMGUI_VERSION_NUM < 19000
    return {};
#else
    return std::unique_lock(device_->mutexOf(device_->window_queue));
#endif
  }

  GLFWwindow* window_;
  DevicePtr device_;
  const int frames_in_flight_;
  Presenter presenter_;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  bool panels_broken_ = false;  // an error left ImGui's back end in the middle of its work
};

void VulkanScreen::startPanels() {
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 8};
  VkDescriptorPoolCreateInfo pool{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO};
  pool.flags = VK_DESCRIPTOR_POOL_CREATE_FREE_DESCRIPTOR_SET_BIT;
  pool.maxSets = size.descriptorCount;
  pool.poolSizeCount = 1;
  pool.pPoolSizes = &size;
  TG_VK(vkCreateDescriptorPool(device_->device, &pool, nullptr, &pool_));

  ImGui_ImplGlfw_InitForVulkan(window_, true);
  ImGui_ImplVulkan_InitInfo info{};
  info.Instance = device_->instance;
  info.PhysicalDevice = device_->physical;
  info.Device = device_->device;
  info.QueueFamily = device_->queue_family;
  info.Queue = device_->window_queue;
  info.DescriptorPool = pool_;
  info.MinImageCount = kVertexBuffers;
  info.ImageCount = kVertexBuffers;
  info.CheckVkResultFn = checkResult;
#if IMGUI_VERSION_NUM < 19030
  info.MSAASamples = VK_SAMPLE_COUNT_1_BIT;
  ImGui_ImplVulkan_Init(&info, presenter_.renderPass());
#else
  info.RenderPass = presenter_.renderPass();
  info.MSAASamples = VK_SAMPLE_COUNT_1_BIT;
  ImGui_ImplVulkan_Init(&info);
#endif
#if IMGUI_VERSION_NUM < 19000
  presenter_.runOnce([](VkCommandBuffer commands) { ImGui_ImplVulkan_CreateFontsTexture(commands); });
  ImGui_ImplVulkan_DestroyFontUploadObjects();
#endif
}

}  // namespace

std::unique_ptr<Screen> makeVulkanScreen(GLFWwindow* window, const ViewOptions& options, const DevicePick& pick) {
  return std::make_unique<VulkanScreen>(window, options, pick);
}

}  // namespace tg
