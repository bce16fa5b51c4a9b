// SPDX-License-Identifier: Apache-2.0
// tgview's window on a device that fails or dawdles when a script says so:
//   lose-device           the next picture on a device fails as on a lost one
//   lose-window-device    the window's next frame does
//   withhold-images COUNT the window system has no image for the window's next so many frames, where it is Vulkan's
//   crowd ROWS            pictures on a device of more rows have more pairs than it has room for
//   cramp ROWS            it has no memory for more rows of a picture that is begun
//   crowd-of-two ROWS     likewise from when two views are under way at once, for which one waits, at most 60 s
//   refused COUNT         fails where that was so of another number of pictures and parts of pictures so far
//   hold-picture FILE     the next picture waits until there is such a file, at most 60 s
//   hold-frame FILE       the next frame of the window waits likewise, after its events; it makes FILE.held before
//   slow-file SECONDS     the next model is read so much later, unless it is cancelled
//   hold-finest on/off    files of the finest level of a scene wait while it is on, at most 60 s
//   await-scene           until a scene with levels of detail is shown
// With TG_NO_COPIES in the environment its window is one that Vulkan may not copy into, with TG_NO_IMAGES one that the
// window system has no image for.
#include <GLFW/glfw3.h>

#ifdef TG_VULKAN
#include <vulkan/vulkan.h>
#endif

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "converter/registry/file_format.h"
#include "core/system/error.h"
#include "core/system/program.h"
#include "viewer/flags.h"
#include "viewer/view/parse.h"
#include "viewer/window/window.h"

using namespace tg;

namespace {

using Clock = std::chrono::steady_clock;

constexpr int kWithoutGlfw = 71;  // exit code: a file was being read when GLFW had ended

// Each is met once.
std::atomic<bool> lose_device{false}, lose_window{false};
std::atomic<int> withheld{0};  // images
std::atomic<int> crowd{std::numeric_limits<int>::max()};
std::atomic<int> cramp{std::numeric_limits<int>::max()};
std::atomic<int> crowd_of_two{0};  // 0: none is waited for
std::atomic<Clock::time_point> two_until;
std::atomic<int> refused{0};
std::atomic<bool> hold_picture{false};
std::filesystem::path held_until;  // written before hold_picture
std::filesystem::path hold_frame;  // of the window's thread; empty: none
std::atomic<double> slow_file{0};  // [s]
std::atomic<bool> hold_finest{false};

constexpr std::array kVerbs = {
    Verb{"lose-device", 0, 1, [](const Call&) { lose_device = true; }},
    Verb{"lose-window-device", 0, 1, [](const Call&) { lose_window = true; }},
    Verb{"withhold-images", 1, 0, [](const Call& c) { withheld = static_cast<int>(c.number(0, 1, 1e6)); }},
    Verb{"crowd", 1, 1, [](const Call& c) { crowd = static_cast<int>(c.number(0, 1, 1e6)); }},
    Verb{"cramp", 1, 1, [](const Call& c) { cramp = static_cast<int>(c.number(0, 1, 1e6)); }},
    Verb{"crowd-of-two", 1, 0,
         [](const Call& c) {
           two_until = Clock::now() + std::chrono::seconds(60);
           crowd_of_two = static_cast<int>(c.number(0, 1, 1e6));
         }},
    Verb{"refused", 1, 0,
         [](const Call& c) {
           if (refused != c.number(0, 0, 1e6)) {
             throw Error(ErrorKind::badData, std::to_string(refused) + " pictures were refused");
           }
         }},
    Verb{"hold-picture", 1, 0,
         [](const Call& c) {
           held_until = c[0];
           hold_picture = true;
         }},
    Verb{"hold-frame", 1, 1, [](const Call& c) { hold_frame = c[0]; }},
    Verb{"slow-file", 1, 0, [](const Call& c) { slow_file = c.number(0, 0, 60); }},
    Verb{"hold-finest", 1, 0, [](const Call& c) { hold_finest = c.on(); }},
    Verb{"await-scene", 0, 1, [](const Call&) {},
         [](const ViewerState& state) { return state.scene.streamed_from > 0; }},
};

void loseIf(std::atomic<bool>& fault) {
  if (fault.exchange(false)) throw Error(ErrorKind::device, "device lost, as a script wants it");
}

void awaitFile(const std::filesystem::path& file) {
  const auto end = Clock::now() + std::chrono::seconds(60);
  while (!std::filesystem::exists(file) && Clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

void dawdle() {
  if (hold_picture.exchange(false)) awaitFile(held_until);
}

Bundle readSlowly(const std::filesystem::path& path, const ReadOptions& options) {
  const auto end = Clock::now() + std::chrono::duration<double>(slow_file.exchange(0));
  while (!options.progress->cancel && Clock::now() < end) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  // What is read wakes the window, by GLFW: its clock tells 0 once it has ended.
  if (glfwGetTime() == 0) std::_Exit(kWithoutGlfw);
  return readModel(path, options);
}

LodReader heldFiles(LodReader files) {
  return [files = std::move(files)](const std::string& relative, std::uint64_t most) {
    const auto end = Clock::now() + std::chrono::seconds(60);
    while (hold_finest && relative.find("/0_") != std::string::npos && Clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return files(relative, most);
  };
}

[[noreturn]] void refuse() {
  ++refused;
  throw DoesNotFit(ErrorKind::device, "more rows than a script allows");
}

// What the CPU draws is only uploaded, and is not lost with the device.
class FaultyDevice final : public PictureDevice {
 public:
  explicit FaultyDevice(std::unique_ptr<PictureDevice> device) : device_(std::move(device)) {}

  std::shared_ptr<PictureImage> makeImage(glm::ivec2 size) override { return device_->makeImage(size); }
  std::unique_ptr<GpuRenderer> makeRenderer() override { return device_->makeRenderer(); }
  bool draw(GpuRenderer& renderer, const FrameRequest& request, PictureImage& target, int top) override {
    loseIf(lose_device);
    dawdle();
    if (request.camera.size.y > std::min<int>(crowd, cramp)) refuse();
    return device_->draw(renderer, request, target, top);
  }
  bool begin(GpuRenderer& renderer, const FrameRequest& request, const std::shared_ptr<PictureImage>& target) override {
    loseIf(lose_device);
    dawdle();
    if (!under_way_.empty() && under_way_.front().ended) return false;
    if (request.camera.size.y > cramp) refuse();
    const bool begun = device_->begin(renderer, request, target);
    if (begun) under_way_.push_back({request.camera, target});
    return begun;
  }
  std::optional<bool> finish(double milliseconds) override {
    if (crowd_of_two > 0) {
      if (under_way_.size() < 2) {
        if (Clock::now() > two_until.load()) throw Error(ErrorKind::badData, "no two pictures were under way");
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
        return std::nullopt;
      }
      if (under_way_[0].camera.rotation != under_way_[1].camera.rotation) crowd = crowd_of_two.exchange(0);
    }
    const UnderWay oldest = under_way_.front();
    const std::optional<bool> whole = oldest.ended ? false : device_->finish(milliseconds);
    if (!whole) return whole;
    under_way_.pop_front();
    if (oldest.ended || oldest.camera.size.y <= crowd) return whole;
    device_->drain();  // nothing may be under way while it is drawn again
    for (UnderWay& later : under_way_) {
      const glm::ivec2 size = later.target->size;
      device_->upload(Image(size.x, size.y, 3), *later.target);  // what was drawn counts for nothing
      later.ended = true;
    }
    refuse();
  }
  void drain() noexcept override {
    device_->drain();
    under_way_.clear();
  }
  void upload(const Image& picture, PictureImage& target) override {
    dawdle();
    device_->upload(picture, target);
  }
  Image download(const PictureImage& source) override { return device_->download(source); }

 private:
  struct UnderWay {
    Camera camera;
    std::shared_ptr<PictureImage> target;
    bool ended = false;  // and must be drawn again
  };

  const std::unique_ptr<PictureDevice> device_;
  std::deque<UnderWay> under_way_;
};

class FaultyScreen final : public Screen {
 public:
  explicit FaultyScreen(std::unique_ptr<Screen> screen) : screen_(std::move(screen)) {}

  bool software() const override { return screen_->software(); }
  int framesInFlight() const override { return screen_->framesInFlight(); }
  std::size_t messages() const override { return screen_->messages(); }
  std::unique_ptr<PictureDevice> makePictureDevice() override {
    return std::make_unique<FaultyDevice>(screen_->makePictureDevice());
  }
  glm::ivec2 size() const override { return screen_->size(); }
  bool acquire(glm::ivec2 framebuffer_size) override {
    if (!hold_frame.empty()) {
      std::ofstream(hold_frame.string() + ".held");
      awaitFile(std::exchange(hold_frame, {}));
    }
    return screen_->acquire(framebuffer_size);
  }
  void draw(std::span<const PictureBlit> pictures, glm::vec3 clear, bool panels) override {
    loseIf(lose_window);
    screen_->draw(pictures, clear, panels);
  }
  Image read(const PictureImage& image) override { return screen_->read(image); }
  Image readWindow() override { return screen_->readWindow(); }
  void present() override { screen_->present(); }
  void startPanels() override { screen_->startPanels(); }
  void beginPanels() override { screen_->beginPanels(); }
  void stopPanels() override { screen_->stopPanels(); }

 private:
  const std::unique_ptr<Screen> screen_;
};

int run(int argc, char** argv) {
  CommandLine line;
  if (const std::optional<int> code = readFlags(argc, argv, line)) return *code;
  const auto wrap = [](std::unique_ptr<Screen> screen) { return std::make_unique<FaultyScreen>(std::move(screen)); };
  runWindow(line.view, {wrap, kVerbs, readSlowly, heldFiles, 3});
  return 0;
}

}  // namespace

#ifdef TG_VULKAN
// The linker puts these before Vulkan's own (--wrap).
extern "C" {
VkResult __real_vkAcquireNextImageKHR(VkDevice, VkSwapchainKHR, std::uint64_t, VkSemaphore, VkFence, std::uint32_t*);
VkResult __real_vkGetPhysicalDeviceSurfaceCapabilitiesKHR(VkPhysicalDevice, VkSurfaceKHR, VkSurfaceCapabilitiesKHR*);

VkResult __wrap_vkAcquireNextImageKHR(VkDevice device, VkSwapchainKHR swapchain, std::uint64_t nanoseconds,
                                      VkSemaphore semaphore, VkFence fence, std::uint32_t* index) {
  constexpr int kWaitsLong = 72;  // exit code: nobody is to wait long for an image
  if (nanoseconds > 1'000'000'000) std::_Exit(kWaitsLong);
  if (std::getenv("TG_NO_IMAGES")) return VK_TIMEOUT;
  if (withheld == 0) return __real_vkAcquireNextImageKHR(device, swapchain, nanoseconds, semaphore, fence, index);
  --withheld;
  return withheld % 2 == 0 ? VK_TIMEOUT : VK_NOT_READY;
}

VkResult __wrap_vkGetPhysicalDeviceSurfaceCapabilitiesKHR(VkPhysicalDevice physical, VkSurfaceKHR surface,
                                                          VkSurfaceCapabilitiesKHR* capabilities) {
  const VkResult result = __real_vkGetPhysicalDeviceSurfaceCapabilitiesKHR(physical, surface, capabilities);
  if (std::getenv("TG_NO_COPIES")) capabilities->supportedUsageFlags = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
  return result;
}
}
#endif

int main(int argc, char** argv) {
  return runProgram("tgview", [&] { return run(argc, argv); });
}
