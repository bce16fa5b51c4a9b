// SPDX-License-Identifier: Apache-2.0
// The interactive viewer: GLFW window, events, and the frame loop.
#include "viewer/window.h"

#include <imgui.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <new>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "render/vulkan/vulkan_renderer.h"
#include "viewer/actions.h"

#include "viewer/follow.h"
#include "viewer/glfw_window.h"
#include "viewer/gui.h"
#include "viewer/input.h"
#include "viewer/panels.h"
#include "viewer/picture_thread.h"
#include "viewer/presenter.h"
#include "viewer/script.h"
#include "viewer/state.h"

namespace tg {
namespace {

constexpr glm::ivec2 kDefaultWindow(1280, 720);
constexpr int kSettleFrames = 3;         // drawn after the last event: widgets answer a frame late
constexpr double kSmoothFrame = 50;      // [ms] a moving picture is drawn smaller when it takes longer than this
constexpr double kSmallestScale = 0.25;  // of that reduction, per side
constexpr double kScriptPause = 0.02;    // [s] between looks at what a script waits for

constexpr glm::vec3 kSurround(0.106f, 0.118f, 0.137f);  // the panel's colour, beside the picture

bool rendersOnCpu(const VulkanDevice& device, Backend backend) {
  const bool software = device.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
  return backend == Backend::cpu || (backend == Backend::automatic && software);
}

class Viewer {
 public:
  explicit Viewer(const ViewOptions& options);
  void run();

 private:
  void waitForEvents();
  PixelRect pictureArea() const;
  void followAspect();
  void handleEvents();
  bool handlePointer();
  void openPending();
  void openModel(const std::filesystem::path& path);
  void takeNews();

  void setTitle();
  void openCameras(const std::filesystem::path& path);
  PictureRequest request(glm::ivec2 size) const;
  void askForPicture(bool moving);
  void takePicture();
  void drawFrame();
  bool capturing() const { return !state_.capture.picture.empty() || !state_.capture.window.empty(); }
  // The picture on screen is that of the present state at full size, or will never come.
  bool complete() const;
  void writeCaptures();
  bool held(int key) const { return glfwGetKey(window_.get(), key) == GLFW_PRESS; }

  ViewOptions options_;
  std::optional<Script> script_;
  LoadedModel first_;  // until the renderer has it
  std::optional<Camera> first_camera_;
  Glfw glfw_;
  Events events_;
  WindowPtr window_;
  std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> device_;
  Presenter presenter_;
  Gui gui_;
  ViewerState state_;
  FrameStatistics statistics_;
  std::optional<PictureRequest> asked_;     // last, of the picture thread
  std::shared_ptr<const Picture> picture_;  // on screen; null before the first
  bool given_up_ = false;                   // what was asked for cannot be drawn
  double last_full_ms_ = 0;                 // of the last picture at full size
  bool open_announced_ = false;
  int frames_since_event_ = 0;
  double last_time_ = 0;
  // Last: their threads wake GLFW and use the device.
  PictureThread pictures_;
  std::optional<ModelFollower> follower_;
};

Viewer::Viewer(const ViewOptions& options)
    : options_(options),
      script_(options.script.empty() ? std::nullopt : std::optional(readScript(options.script))),
      first_(options.follow ? LoadedModel{} : readModel(options.model)),
      first_camera_(options.camera.empty() || options.follow
                        ? std::nullopt
                        : std::optional(cameraOf(options.camera, first_.cameras, "--camera"))),
      window_(openWindow(options.size.value_or(kDefaultWindow), events_)),
      device_(createWindowDevice(window_.get(), options)),

      presenter_(*device_),
      gui_(window_.get(), *device_, presenter_),
      pictures_(*device_, rendersOnCpu(*device_, options.backend), glfwPostEmptyEvent) {
  state_.display.output = options.show;
  state_.display.settings.textures = options.textures;
  state_.display.settings.intersection = options.intersection;
  setTitle();
  if (options.follow) {
    state_.follow.active = true;
    follower_.emplace(options.model, glfwPostEmptyEvent);
  }
}

void Viewer::setTitle() {
  const Scene& scene = state_.scene;
  std::string title = "tgview - " + (scene.path.empty() ? options_.model : scene.path).filename().string();
  if (!scene.training.empty()) title += " - " + scene.training;
  glfwSetWindowTitle(window_.get(), title.c_str());
}

void Viewer::run() {
  bool started = false;
  while (!state_.quit && !glfwWindowShouldClose(window_.get())) {
    waitForEvents();
    glm::ivec2 pixels;
    glfwGetFramebufferSize(window_.get(), &pixels.x, &pixels.y);
    if (!presenter_.acquire(pixels)) {
      glfwWaitEventsTimeout(0.1);
      continue;
    }
    state_.time = glfwGetTime();
    gui_.beginFrame();
    if (!started) {
      const PixelRect area = pictureArea();
      state_.camera.aspect = static_cast<double>(area.size.x) / area.size.y;
      if (!options_.follow) setScene(state_, describe(std::move(first_), options_.model));
      if (options_.background) state_.display.settings.background = *options_.background;
      if (first_camera_) setCamera(state_, *first_camera_);
      started = true;
    }
    followAspect();
    openPending();
    takeNews();
    takePicture();
    if (script_ && complete() && !capturing()) {
      if (const auto size = step(*script_, state_)) glfwSetWindowSize(window_.get(), size->x, size->y);
    }
    handleEvents();
    const bool moving = handlePointer();
    drawPanels(state_, statistics_);
    gui_.endFrame();
    followAspect();
    askForPicture(moving);
    drawFrame();
    if (complete() || !capturing()) writeCaptures();
    presenter_.present();
  }
  if (!device_->validation_messages.empty()) {
    throw Error(ErrorKind::device,
                std::to_string(device_->validation_messages.size()) + " validation messages (expected none)");
  }
}

// Sleeps while nothing changes: a still picture costs nothing. A finished picture is an event.
void Viewer::waitForEvents() {
  if (script_ && (capturing() || !complete())) {
    glfwWaitEventsTimeout(kScriptPause);
  } else if (script_ || state_.open_request || frames_since_event_ < kSettleFrames) {
    glfwPollEvents();
    ++frames_since_event_;
  } else {
    // A notice that must fade is the only thing that changes by itself.
    if (state_.time < state_.messages.notice_until)
      glfwWaitEventsTimeout(state_.messages.notice_until - state_.time + 0.01);
    else
      glfwWaitEvents();
    frames_since_event_ = 0;
  }
}

PixelRect Viewer::pictureArea() const {
  const ImGuiIO& io = ImGui::GetIO();
  const glm::ivec2 window = presenter_.size();
  const float panel = panelWidth(state_, io.DisplaySize.x) * io.DisplayFramebufferScale.x;
  PixelRect area;
  area.origin.x = std::min(static_cast<int>(std::ceil(panel)), window.x - 1);
  area.size = window - area.origin;
  return area;
}

// A model's camera stays wholly in view when the window changes its shape.
void Viewer::followAspect() {
  const PixelRect area = pictureArea();
  const double aspect = static_cast<double>(area.size.x) / area.size.y;
  if (aspect == state_.camera.aspect) return;
  state_.camera.aspect = aspect;
  if (state_.camera.index >= 0) state_.camera.lens = lensOf(state_.scene.cameras[state_.camera.index], aspect);
}

void Viewer::handleEvents() {
  const Events events = std::exchange(events_, {});
  for (const auto& [key, shift] : events.keys) {
    if (ImGui::GetIO().WantTextInput) break;
    if (key == kKeyEscape && popupIsOpen()) continue;  // closes the list, not the viewer
    if (const auto action = actionOf(key, shift)) apply(state_, *action);
  }
  if (!events.dropped.empty()) state_.open_request = events.dropped.front();
}

bool Viewer::handlePointer() {
  const ImGuiIO& io = ImGui::GetIO();
  Input input;
  input.seconds = std::clamp(state_.time - last_time_, 0.0, 0.25);
  last_time_ = state_.time;
  input.shift = io.KeyShift;
  input.control = io.KeyCtrl;
  if (!io.WantCaptureMouse) {
    input.drag = {io.MouseDelta.x, io.MouseDelta.y};
    input.wheel = io.MouseWheel;
    input.left = io.MouseDown[0];
    input.right = io.MouseDown[1];
    input.middle = io.MouseDown[2];
  }
  if (!io.WantTextInput) {
    const auto axis = [this](int positive, int negative) { return held(positive) - held(negative); };
    input.fly = {axis(GLFW_KEY_D, GLFW_KEY_A), axis(GLFW_KEY_Q, GLFW_KEY_E), axis(GLFW_KEY_W, GLFW_KEY_S)};
    input.roll = axis(GLFW_KEY_X, GLFW_KEY_Z);
  }
  if (!script_) state_.display.textures_held_off = !io.WantTextInput && held(kKeyTab);
  const double units_high = pictureArea().size.y / std::max(io.DisplayFramebufferScale.y, 1e-3f);
  const bool moved = applyInput(state_, input, static_cast<int>(units_high));
  const bool active = moved || input.fly != glm::dvec3(0.0) || input.roll != 0;
  if (active) frames_since_event_ = 0;
  return active;
}

// A file is opened one frame after it was asked for, so that the notice is on screen meanwhile.
void Viewer::openPending() {
  if (!state_.open_request) return;
  if (!open_announced_) {
    notify(state_, "Opening " + state_.open_request->filename().string());
    open_announced_ = true;
    return;
  }
  const std::filesystem::path path = *std::exchange(state_.open_request, std::nullopt);
  open_announced_ = false;
  try {
    if (path.extension() == ".json")
      openCameras(path);
    else
      openModel(path);
  } catch (const Error& error) {
    state_.messages.error = error.what();
    state_.messages.notice_until = 0;
  } catch (const std::bad_alloc&) {
    state_.messages.error = path.string() + ": not enough memory";
    state_.messages.notice_until = 0;
  }
}

void Viewer::openModel(const std::filesystem::path& path) {
  setScene(state_, describe(readModel(path), path));
  setTitle();
  notify(state_, "Opened " + path.filename().string());
  if (follower_ && path != follower_->file()) {
    follower_.reset();
    state_.follow.active = false;
  }
}

// What --follow has found since the last frame. The first model opens like any other; later ones change nothing but
// the model.
void Viewer::takeNews() {
  if (!follower_) return;
  std::optional<ModelFollower::News> news = follower_->take();
  if (!news) return;
  frames_since_event_ = 0;
  state_.follow.problem = news->problem;
  if (!news->model) return;
  try {
    Scene scene = describe(std::move(*news->model), follower_->file());
    if (state_.follow.reloads++ > 0) {
      replaceScene(state_, std::move(scene));
    } else {
      const std::vector<Camera> cameras = scene.cameras;
      setScene(state_, std::move(scene));
      if (options_.background) state_.display.settings.background = *options_.background;
      if (!options_.camera.empty()) setCamera(state_, cameraOf(options_.camera, cameras, "--camera"));
    }
    setTitle();
  } catch (const std::bad_alloc&) {
    state_.follow.problem = follower_->file().string() + ": not enough memory";
  }
}

void Viewer::openCameras(const std::filesystem::path& path) {
  std::vector<Camera> cameras = readCameras(path);
  if (cameras.empty())
    throw Error(ErrorKind::badData, path.string(), "no camera inside (expected at least 1, found 0)");
  state_.scene.cameras = std::move(cameras);
  goToCamera(state_, startCamera(state_.scene.cameras));
  notify(state_, std::to_string(state_.scene.cameras.size()) + " cameras from " + path.filename().string());
}

PictureRequest Viewer::request(glm::ivec2 size) const {
  return {state_.scene.model, toCamera(state_.camera.pose, state_.camera.lens, size.x, size.y),
          effectiveSettings(state_), state_.display.output};
}

bool Viewer::complete() const {
  if (!state_.scene.model || given_up_) return true;
  return picture_ && same(picture_->request, request(pictureArea().size));
}

void Viewer::askForPicture(bool moving) {
  if (!state_.scene.model) return;
  glm::ivec2 size = pictureArea().size;
  const bool reduced = moving && !capturing() && last_full_ms_ > kSmoothFrame;
  if (reduced) {
    const double scale = std::max(std::sqrt(kSmoothFrame / last_full_ms_), kSmallestScale);
    size = glm::max(glm::ivec2(glm::dvec2(size) * scale), glm::ivec2(1));
    frames_since_event_ = 0;  // the full picture is still owed
  }
  const PictureRequest wanted = request(size);
  const bool again = state_.ui.continuous && pictures_.idle();
  if (asked_ && same(*asked_, wanted) && !again) return;
  asked_ = wanted;
  given_up_ = false;
  pictures_.ask(wanted);
}

void Viewer::takePicture() {
  PictureThread::News news = pictures_.take();
  if (!news.problem.empty()) {
    if (script_ && news.given_up) throw Error(ErrorKind::device, news.problem);
    state_.messages.error = news.problem;
  }
  given_up_ = given_up_ || news.given_up;
  if (!news.picture) return;
  picture_ = std::move(news.picture);
  const glm::ivec2 size = picture_->image->size;
  statistics_.reduced = size != pictureArea().size;
  if (!statistics_.reduced) last_full_ms_ = picture_->milliseconds;
  statistics_.frame_ms.push_back(static_cast<float>(picture_->milliseconds));
  if (statistics_.frame_ms.size() > kFrameHistory) statistics_.frame_ms.erase(statistics_.frame_ms.begin());
  statistics_.passes = picture_->passes;
  statistics_.device = picture_->device;
  statistics_.picture_size = size;
}

void Viewer::drawFrame() {
  // The window system may already have another size than the panels were laid out for.
  const ImGuiIO& io = ImGui::GetIO();
  const glm::ivec2 laid_out(std::lround(io.DisplaySize.x * io.DisplayFramebufferScale.x),
                            std::lround(io.DisplaySize.y * io.DisplayFramebufferScale.y));
  const VkCommandBuffer commands = presenter_.beginCommands();
  std::vector<PictureBlit> blits;
  if (picture_) {
    const glm::ivec2 size = picture_->image->size;
    blits.push_back({picture_->image->storage.handle(), {{0, 0}, size}, pictureArea()});
  }
  presenter_.recordPictures(blits, kSurround);
  presenter_.beginPanels();
  if (laid_out == presenter_.size()) gui_.record(commands);
  presenter_.endPanels();
  presenter_.submitAndWait();
}

void Viewer::writeCaptures() {
  const CaptureRequest capture = std::exchange(state_.capture, {});
  const auto saved = [this](const std::filesystem::path& path) {
    if (!script_) notify(state_, "Saved " + path.string());  // the next capture of a script must not show it
  };
  try {
    if (!capture.picture.empty()) {
      writeImage(capture.picture, presenter_.read(picture_->image->storage.handle(), picture_->image->size));
      saved(capture.picture);
    }
    if (!capture.window.empty()) {
      writeImage(capture.window, presenter_.readWindow());
      saved(capture.window);
    }
    if (!capture.camera.empty()) {
      const glm::ivec2 size = pictureArea().size;
      Camera camera = toCamera(state_.camera.pose, state_.camera.lens, size.x, size.y);
      camera.name = state_.scene.path.stem().string();
      const std::string text = formatCameras({camera});
      writeFileAtomically(capture.camera, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
      saved(capture.camera);
    }
  } catch (const Error& error) {
    if (script_) throw;
    state_.messages.error = error.what();
  }
}

}  // namespace

void runWindow(const ViewOptions& options) {
  Viewer viewer(options);
  viewer.run();
}

}  // namespace tg
