// SPDX-License-Identifier: Apache-2.0
// Windows on OpenGL: the window's context, and another one for the thread that makes pictures.
#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "core/system/error.h"
#include "render/gl/gl_renderer.h"
#include "viewer/window/glfw.h"
#include "viewer/window/screen.h"

namespace tg {
namespace {

constexpr std::size_t kMostFrames = 2;              // of the window, under way
constexpr GLuint64 kLongestWait = 300'000'000'000;  // [ns] software devices compile shaders in the first frame

class GlPictureImage final : public PictureImage {
 public:
  explicit GlPictureImage(glm::ivec2 s) : PictureImage(s) {
    glCreateTextures(GL_TEXTURE_2D, 1, &texture_);
    glTextureStorage2D(texture_, 1, GL_RGBA8, s.x, s.y);
  }
  GlPictureImage& operator=(GlPictureImage&&) = delete;
  ~GlPictureImage() override { glDeleteTextures(1, &texture_); }
  GLuint texture() const { return texture_; }

 private:
  GLuint texture_ = 0;
};

GLuint textureOf(const PictureImage& image) { return static_cast<const GlPictureImage&>(image).texture(); }

Image readTexture(const GlDevice& device, GLuint texture, glm::ivec2 size) {
  std::vector<std::byte> pixels(std::size_t{4} * size.x * size.y);
  glGetTextureImage(texture, 0, GL_RGBA, GL_UNSIGNED_BYTE, static_cast<GLsizei>(pixels.size()), pixels.data());
  checkGl(device, "a picture's read-back");
  return imageFromRgba8(pixels, size.x, size.y);
}

class GlPictureDevice final : public PictureDevice {
 public:
  GlPictureDevice(GLFWwindow* context, GlDevice& device) : device_(device), programs_(makeGlPrograms(device)) {
    glfwMakeContextCurrent(context);
  }
  GlPictureDevice& operator=(GlPictureDevice&&) = delete;
  ~GlPictureDevice() override {
    programs_.reset();
    glfwMakeContextCurrent(nullptr);
  }

  std::shared_ptr<PictureImage> makeImage(glm::ivec2 size) override {
    auto image = std::make_shared<GlPictureImage>(size);
    checkGl(device_, "making room for a picture");
    return image;
  }
  std::unique_ptr<GpuRenderer> makeRenderer() override { return makeGlRenderer(device_, programs_); }

  bool draw(GpuRenderer& renderer, const FrameRequest& request, PictureImage& target, int top) override {
    const bool complete = renderer.draw(request);
    glCopyImageSubData(static_cast<GlRenderer&>(renderer).texture(), GL_TEXTURE_2D, 0, 0, 0, 0, textureOf(target),
                       GL_TEXTURE_2D, 0, 0, top, 0, target.size.x, request.camera.size.y, 1);
    waitFor("a picture");
    return complete;
  }

  void upload(const Image& picture, PictureImage& target) override {
    staging_.resize(std::size_t{4} * target.size.x * target.size.y);
    toRgba8(picture, staging_);
    glTextureSubImage2D(textureOf(target), 0, 0, 0, target.size.x, target.size.y, GL_RGBA, GL_UNSIGNED_BYTE,
                        staging_.data());
    waitFor("a picture's upload");
  }

  Image download(const PictureImage& source) override { return readTexture(device_, textureOf(source), source.size); }

 private:
  // The window's context sees what has ended in this one.
  void waitFor(const char* what) {
    glFinish();
    checkGl(device_, what);
  }

  GlDevice& device_;
  std::shared_ptr<GlPrograms> programs_;  // of all models: an edit makes a renderer anew
  std::vector<std::byte> staging_;
};

// Pixels that either thread may read while it holds the image.
class MemoryPictureImage final : public PictureImage {
 public:
  explicit MemoryPictureImage(glm::ivec2 s) : PictureImage(s), pixels(std::size_t{4} * s.x * s.y) {}
  std::span<std::byte> rowsFrom(int top) { return std::span(pixels).subspan(std::size_t{4} * size.x * top); }

  std::vector<std::byte> pixels;  // RGBA8
  std::uint64_t version = 0;      // another one for other pixels
};

const MemoryPictureImage& inMemory(const PictureImage& image) { return static_cast<const MemoryPictureImage&>(image); }

std::size_t countMessages(const GlDevice& device) {
  const std::lock_guard lock(device.messages_mutex);
  return device.debug_messages.size();
}

// Draws in a display of its own, from where pictures go through memory: before llvmpipe uses a texture it looks through
// the frames that any context of its display has under way, which another thread may be freeing.
class MemoryPictureDevice final : public PictureDevice {
 public:
  // The window takes images of `most` pixels a side. Tells `messages` how many there were. The CPU's pictures want no
  // context: without libEGL these are left.
  MemoryPictureDevice(GlOptions options, std::uint32_t most, std::atomic<std::size_t>& messages)
      : options_(std::move(options)), most_(most), messages_(messages) {}

  std::shared_ptr<PictureImage> makeImage(glm::ivec2 size) override {
    if (static_cast<std::uint32_t>(std::max(size.x, size.y)) > most_) {
      throw Error(ErrorKind::device, options_.device,
                  "OpenGL: a picture of " + std::to_string(size.x) + " x " + std::to_string(size.y) +
                      " pixels (expected at most " + std::to_string(most_) + " a side)");
    }
    return std::make_shared<MemoryPictureImage>(size);
  }

  std::unique_ptr<GpuRenderer> makeRenderer() override {
    if (!device_) {
      device_ = createGlDevice(options_);
      programs_ = makeGlPrograms(*device_);
    }
    const Count count(*this);
    return makeGlRenderer(*device_, programs_);
  }

  bool draw(GpuRenderer& renderer, const FrameRequest& request, PictureImage& target, int top) override {
    const Count count(*this);
    const bool complete = renderer.draw(request);
    auto& image = static_cast<MemoryPictureImage&>(target);
    const std::span<std::byte> rows = image.rowsFrom(top);
    glGetTextureSubImage(static_cast<GlRenderer&>(renderer).texture(), 0, 0, 0, 0, image.size.x, request.camera.size.y,
                         1, GL_RGBA, GL_UNSIGNED_BYTE, static_cast<GLsizei>(rows.size()), rows.data());
    checkGl(*device_, "a picture");
    ++image.version;
    return complete;
  }

  void upload(const Image& picture, PictureImage& target) override {
    auto& image = static_cast<MemoryPictureImage&>(target);
    toRgba8(picture, image.pixels);
    ++image.version;
  }

  Image download(const PictureImage& source) override {
    return imageFromRgba8(inMemory(source).pixels, source.size.x, source.size.y);
  }

 private:
  // Messages, however what follows ends.
  struct Count {
    explicit Count(const MemoryPictureDevice& d) : of(d) {}
    Count& operator=(Count&&) = delete;
    ~Count() { of.messages_ = countMessages(*of.device_); }
    const MemoryPictureDevice& of;
  };

  const GlOptions options_;
  const std::uint32_t most_;
  std::atomic<std::size_t>& messages_;
  std::unique_ptr<GlDevice> device_;
  std::shared_ptr<GlPrograms> programs_;  // of all models: an edit makes a renderer anew
};

// The window's textures of pictures in memory, in whose context all of them are used.
class PictureTextures {
 public:
  PictureTextures() = default;
  PictureTextures& operator=(PictureTextures&&) = delete;
  ~PictureTextures() {
    for (const Entry& entry : entries_) glDeleteTextures(1, &entry.texture);
  }

  // The texture has the pixels that the image has now.
  GLuint of(const std::shared_ptr<const PictureImage>& image) {
    const MemoryPictureImage& memory = inMemory(*image);
    auto found = std::ranges::find_if(entries_, [&](const Entry& entry) {
      return !entry.image.owner_before(image) && !image.owner_before(entry.image);  // lock() would make it look used
    });
    if (found == entries_.end()) {
      found = entries_.insert(entries_.end(), Entry{image, 0, memory.version - 1});
      glCreateTextures(GL_TEXTURE_2D, 1, &found->texture);
      glTextureStorage2D(found->texture, 1, GL_RGBA8, image->size.x, image->size.y);
    }
    if (found->version != memory.version) {
      glTextureSubImage2D(found->texture, 0, 0, 0, image->size.x, image->size.y, GL_RGBA, GL_UNSIGNED_BYTE,
                          memory.pixels.data());
      found->version = memory.version;
    }
    return found->texture;
  }

  // Those of images that are no more.
  void forget() {
    std::erase_if(entries_, [](const Entry& entry) {
      const bool gone = entry.image.expired();
      if (gone) glDeleteTextures(1, &entry.texture);
      return gone;
    });
  }

 private:
  struct Entry {
    std::weak_ptr<const PictureImage> image;
    GLuint texture;
    std::uint64_t version;
  };
  std::vector<Entry> entries_;
};

class GlScreen final : public Screen {
 public:
  GlScreen(GLFWwindow* window, const ViewOptions& options, const std::string& device, GlSharing sharing)
      : GlScreen(window, options) {  // from here on the destructor runs, whatever is thrown
    requirePicked(device);
    if (sharing == GlSharing::always || !device_->software) {
      shared_ = openSharedContext(window);
      glfwMakeContextCurrent(shared_.get());
      picture_device_ = wrapGlContext(options_);
      glfwMakeContextCurrent(window_);
    }
    const std::string& name = device_->limits.device;
    options_.device = name.substr(0, name.find(" ("));  // libEGL's may be of another version
    glfwSwapInterval(1);
    glCreateFramebuffers(1, &source_);
  }
  GlScreen& operator=(GlScreen&&) = delete;
  ~GlScreen() override {
    glfwMakeContextCurrent(window_);
    for (const Frame& frame : frames_) glDeleteSync(frame.ended);
    glDeleteFramebuffers(1, &source_);
    if (device_->debug) glDebugMessageCallback(nullptr, nullptr);
  }

  bool software() const override { return device_->software; }
  int framesInFlight() const override { return 1; }
  std::size_t messages() const override {
    return countMessages(*device_) + (picture_device_ ? countMessages(*picture_device_) : picture_messages_.load());
  }
  std::unique_ptr<PictureDevice> makePictureDevice() override {
    if (!shared_) return std::make_unique<MemoryPictureDevice>(options_, device_->limits.image_side, picture_messages_);
    return std::make_unique<GlPictureDevice>(shared_.get(), *picture_device_);
  }

  glm::ivec2 size() const override { return size_; }
  bool acquire(glm::ivec2 framebuffer_size) override {
    releaseEnded();
    size_ = framebuffer_size;
    return size_.x > 0 && size_.y > 0;
  }

  // The window counts rows from below.
  void draw(std::span<const PictureBlit> pictures, glm::vec3 clear, bool panels) override {
    const GLfloat color[] = {clear.r, clear.g, clear.b, 1.0f};
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    glDisable(GL_SCISSOR_TEST);
    glViewport(0, 0, size_.x, size_.y);
    glClearBufferfv(GL_COLOR, 0, color);
    for (const PictureBlit& blit : pictures) {
      const GLuint texture = shared_ ? textureOf(*blit.image) : textures_.of(blit.image);
      glNamedFramebufferTexture(source_, GL_COLOR_ATTACHMENT0, texture, 0);
      const glm::ivec2 first = blit.from.origin, last = first + blit.from.size;
      const glm::ivec2 top = blit.to.origin, bottom = top + blit.to.size;
      glBlitNamedFramebuffer(source_, 0, first.x, first.y, last.x, last.y, top.x, size_.y - top.y, bottom.x,
                             size_.y - bottom.y, GL_COLOR_BUFFER_BIT,
                             blit.from.size == blit.to.size ? GL_NEAREST : GL_LINEAR);
    }
    glNamedFramebufferTexture(source_, GL_COLOR_ATTACHMENT0, 0, 0);
    textures_.forget();
    if (panels) ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
    checkGl(*device_, "drawing the window");
    Frame& frame = frames_.emplace_back();
    for (const PictureBlit& blit : pictures) frame.pictures.push_back(blit.image);
    frame.ended = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  }

  Image read(const PictureImage& image) override {
    if (!shared_) return imageFromRgba8(inMemory(image).pixels, image.size.x, image.size.y);
    return readTexture(*device_, textureOf(image), image.size);
  }

  Image readWindow() override {
    std::vector<std::byte> pixels(std::size_t{4} * size_.x * size_.y);
    glReadBuffer(GL_BACK);
    glReadPixels(0, 0, size_.x, size_.y, GL_RGBA, GL_UNSIGNED_BYTE, pixels.data());
    checkGl(*device_, "reading the window");
    const Image below = imageFromRgba8(pixels, size_.x, size_.y);
    Image image(size_.x, size_.y, 3);
    const auto row = static_cast<std::ptrdiff_t>(3) * size_.x;
    for (int y = 0; y < size_.y; ++y) {
      std::copy_n(below.data.begin() + (size_.y - 1 - y) * row, row, image.data.begin() + y * row);
    }
    return image;
  }

  void present() override { glfwSwapBuffers(window_); }

  void startPanels() override {
    ImGui_ImplGlfw_InitForOpenGL(window_, true);
    ImGui_ImplOpenGL3_Init("#version 450");
  }
  void beginPanels() override {
    ImGui_ImplOpenGL3_NewFrame();
    ImGui_ImplGlfw_NewFrame();
  }
  void stopPanels() override {
    const ImGuiIO& io = ImGui::GetIO();
    if (io.BackendRendererUserData) ImGui_ImplOpenGL3_Shutdown();
    if (io.BackendPlatformUserData) ImGui_ImplGlfw_Shutdown();
  }

 private:
  // Its pictures are not the picture thread's again before it has ended.
  struct Frame {
    GLsync ended = nullptr;
    std::vector<std::shared_ptr<const PictureImage>> pictures;
  };

  GlScreen(GLFWwindow* window, const ViewOptions& options) : window_(window) {
    options_.debug = options.validation;
    glfwMakeContextCurrent(window_);
    device_ = wrapGlContext(options_);
  }

  // Waits for no more than leaves kMostFrames under way.
  void releaseEnded() {
    while (!frames_.empty()) {
      const GLuint64 wait = frames_.size() > kMostFrames ? kLongestWait : 0;
      const GLenum result = glClientWaitSync(frames_.front().ended, GL_SYNC_FLUSH_COMMANDS_BIT, wait);
      if (result == GL_TIMEOUT_EXPIRED && wait == 0) return;
      if (result == GL_TIMEOUT_EXPIRED) throw Error(ErrorKind::device, "OpenGL: a frame of the window does not end");
      glDeleteSync(frames_.front().ended);
      frames_.pop_front();
    }
  }

  void requirePicked(const std::string& wanted) const {
    const std::string& drawing = device_->limits.device;
    if (drawing.find(wanted) != std::string::npos) return;
    throw Error(ErrorKind::device, "the window system lets OpenGL draw on \"" + drawing + "\" (expected \"" + wanted +
                                       "\", which --render can use)");
  }

  GLFWwindow* window_;
  GlOptions options_;                                  // of another context on the same device
  std::unique_ptr<GlDevice> device_, picture_device_;  // the latter keeps what shared_ says to its end
  WindowPtr shared_;                               // the pictures' context, never shown; none: they come through memory
  std::atomic<std::size_t> picture_messages_ = 0;  // without picture_device_
  PictureTextures textures_;                       // likewise
  GLuint source_ = 0;                              // framebuffer that pictures are read from
  glm::ivec2 size_{0};
  std::deque<Frame> frames_;
};

}  // namespace

std::unique_ptr<Screen> makeGlScreen(GLFWwindow* window, const ViewOptions& options, const DevicePick& pick,
                                     GlSharing sharing) {
  // While no context is current: the list makes contexts of its own.
  const std::string device = pick.index ? listGlDevices().at(*pick.index).limits.device : pick.name;
  return std::make_unique<GlScreen>(window, options, device, sharing);
}

}  // namespace tg
