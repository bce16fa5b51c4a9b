// SPDX-License-Identifier: Apache-2.0
// The interactive viewer: GLFW window, events, and the frame loop.
#include "viewer/window.h"

#include <imgui.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <utility>

#include "converter/file_format.h"
#include "core/error.h"
#include "core/file.h"
#include "render/vulkan/check.h"
#include "viewer/actions.h"
#include "viewer/benchmark.h"
#include "viewer/document_keeper.h"
#include "viewer/graphics.h"
#include "viewer/input.h"
#include "viewer/metrics_thread.h"
#include "viewer/panels.h"
#include "viewer/photographs.h"
#include "viewer/script.h"
#include "viewer/state.h"

namespace tg {
namespace {

constexpr glm::ivec2 kDefaultWindow(1280, 720);
constexpr int kSettleFrames = 3;         // drawn after the last event: widgets answer a frame late
constexpr double kSmoothFrame = 50;      // [ms] a moving picture is drawn smaller when it takes longer than this
constexpr double kSmallestScale = 0.25;  // of that reduction, per side
constexpr double kProgressPause = 0.05;  // [s] between frames while a file is read
constexpr float kDividerReach = 6;       // [ImGui units] around the line of a wipe
constexpr double kScriptPause = 0.02;    // [s] between looks at what a script waits for

constexpr glm::vec3 kSurround(0.106f, 0.118f, 0.137f);  // the panel's colour, beside the picture

class Viewer {
 public:
  explicit Viewer(const ViewOptions& options);
  ~Viewer() { awake_ = false; }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;
  void run();

 private:
  void waitForEvents();
  PixelRect pictureArea() const;
  void followAspect();
  void handleEvents();
  bool handlePointer();
  void openCameraFiles();
  void adopt(Scene scene);
  bool scriptMayGoOn() const;
  bool onDevice(const std::function<void()>& draw);
  void printTimings();

  void setTitle();
  void openCameras(const std::filesystem::path& path);
  PictureRequest request(glm::ivec2 size) const;
  glm::ivec2 pictureSize() const;
  std::optional<OtherPicture> otherPicture(std::string& problem) const;
  void updateComparison();
  void measure();
  bool dragDivider();
  bool measuring() const;
  Image capturedPicture();
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
  const std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
  std::atomic<bool> awake_{false};  // GLFW may be called from other threads
  DocumentKeeper documents_;
  std::optional<Photographs> photographs_;
  MetricsThread metrics_;
  Glfw glfw_;
  Events events_;
  WindowPtr window_;
  std::unique_ptr<Graphics> graphics_;
  ViewerState state_;
  FrameStatistics statistics_;
  std::shared_ptr<const PicturePair> measured_;  // last, by the thread of metrics
  double flickered_ = 0;                         // [s] window time
  bool dragging_divider_ = false;
  std::optional<PictureRequest> asked_;     // last, of the picture thread
  std::shared_ptr<const Picture> picture_;  // on screen; null before the first
  bool given_up_ = false;                   // what was asked for cannot be drawn
  double last_full_ms_ = 0;                 // of the last picture at full size
  double first_picture_ = 0;                // [s] from the start; 0: not yet
  double first_picture_cpu_ = 0;            // [s] of the process until then
  bool timings_printed_ = false;
  bool recovered_ = false;               // the device has failed once
  std::size_t validation_messages_ = 0;  // of a device that has failed
  int frames_since_event_ = 0;
  double last_time_ = 0;
};

Viewer::Viewer(const ViewOptions& options)
    : options_(options),
      script_(options.script.empty() ? std::nullopt : std::optional(readScript(options.script))),
      documents_(
          options,
          [this] {
            if (awake_) glfwPostEmptyEvent();
          },
          [this](ViewerState&, Scene scene) { adopt(std::move(scene)); }),
      photographs_(options.photographs.empty() ? std::nullopt : std::make_optional<Photographs>(options.photographs)),
      metrics_([this] {
        if (awake_) glfwPostEmptyEvent();
      }),
      window_(openWindow(options.size.value_or(kDefaultWindow), events_)),
      graphics_(std::make_unique<Graphics>(window_.get(), options)) {
  awake_ = true;
  state_.display.output = options.show;
  state_.display.settings.textures = options.textures;
  state_.display.settings.intersection = options.intersection;
  state_.follow.active = options.follow;
  state_.compare.photographs = options.photographs;
  state_.compare.with_photographs = !options.photographs.empty();
  state_.compare.other = options.compare;
  if (!options.compare.empty() || photographs_) state_.compare.how.mode = options.compare_mode;
  setTitle();
}

void Viewer::setTitle() {
  const Scene& scene = state_.scene;
  std::string title = "tgview - " + (scene.path.empty() ? options_.model : scene.path).filename().string();
  if (!scene.training.empty()) title += " - " + scene.training;
  glfwSetWindowTitle(window_.get(), title.c_str());
}

void Viewer::run() {
  while (!state_.quit && !glfwWindowShouldClose(window_.get())) {
    waitForEvents();
    glm::ivec2 pixels;
    glfwGetFramebufferSize(window_.get(), &pixels.x, &pixels.y);
    bool visible = false;
    if (!onDevice([&] { visible = graphics_->presenter.acquire(pixels); })) continue;
    if (!visible) {
      glfwWaitEventsTimeout(0.1);
      continue;
    }
    state_.time = glfwGetTime();
    graphics_->gui.beginFrame();
    followAspect();
    openCameraFiles();
    takePicture();
    if (state_.loading.part_owed) state_.loading.part_owed = state_.scene.partial && !complete();
    if (documents_.update(state_)) {
      frames_since_event_ = 0;
      setTitle();
    }
    if (script_ && scriptMayGoOn()) {
      if (const auto size = step(*script_, state_)) glfwSetWindowSize(window_.get(), size->x, size->y);
    }
    if (std::exchange(state_.test.lose_renderer, false)) {
      graphics_->pictures.loseDevice();
      asked_.reset();
      picture_.reset();
    }
    handleEvents();
    const bool moving = handlePointer();
    updateComparison();
    drawPanels(state_, statistics_);
    graphics_->gui.endFrame();
    followAspect();
    askForPicture(moving);
    measure();
    onDevice([&] {
      if (std::exchange(state_.test.lose_window, false)) TG_VK(VK_ERROR_DEVICE_LOST);
      drawFrame();
      if ((complete() && !measuring()) || !capturing()) writeCaptures();
      graphics_->presenter.present();
    });
  }
  validation_messages_ += graphics_->device->validation_messages.size();
  if (validation_messages_ > 0) {
    throw Error(ErrorKind::device, std::to_string(validation_messages_) + " validation messages (expected none)");
  }
}

// Runs what talks to the device outside of the picture thread. When that fails everything on the device is made anew,
// with the CPU renderer; false then. Throws when it fails again.
bool Viewer::onDevice(const std::function<void()>& draw) {
  try {
    draw();
    return true;
  } catch (const Error& error) {
    if (error.kind != ErrorKind::device || recovered_) throw;
    recovered_ = true;
    state_.messages.error = std::string("The device failed, the CPU renders from here on: ") + error.what();
  }
  validation_messages_ += graphics_->device->validation_messages.size();
  picture_.reset();
  asked_.reset();
  graphics_.reset();
  ViewOptions options = options_;
  options.backend = Backend::cpu;
  graphics_ = std::make_unique<Graphics>(window_.get(), options);
  frames_since_event_ = 0;
  return false;
}

bool Viewer::scriptMayGoOn() const {
  const DocumentState& documents = state_.documents;
  const bool asked = !documents.open_requests.empty() || documents.show_request || documents.close_request;
  const bool loading = state_.loading.active && !state_.loading.script_goes_on;
  return complete() && !measuring() && !capturing() && !asked && !loading;
}

// Sleeps while nothing changes: a still picture costs nothing. A finished picture is an event, and so is a model.
void Viewer::waitForEvents() {
  if (script_ && !scriptMayGoOn()) {
    glfwWaitEventsTimeout(kScriptPause);
  } else if (script_ || frames_since_event_ < kSettleFrames) {
    glfwPollEvents();
    ++frames_since_event_;
  } else if (state_.compare.how.mode == CompareMode::flicker && state_.compare.timed) {
    glfwWaitEventsTimeout(std::max(state_.compare.flicker_seconds - (glfwGetTime() - flickered_), 1e-3));
  } else if (state_.loading.active) {
    glfwWaitEventsTimeout(kProgressPause);
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
  const glm::ivec2 window = graphics_->presenter.size();
  const float panel = panelWidth(state_, io.DisplaySize.x) * io.DisplayFramebufferScale.x;
  PixelRect area;
  area.origin.x = std::min(static_cast<int>(std::ceil(panel)), window.x - 1);
  area.size = window - area.origin;
  return area;
}

// A model's camera stays wholly in view when the window changes its shape.
void Viewer::followAspect() {
  const glm::ivec2 size = pictureSize();
  const double aspect = static_cast<double>(size.x) / size.y;
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
  state_.documents.open_requests.insert(state_.documents.open_requests.end(), events.dropped.begin(),
                                        events.dropped.end());
}

bool Viewer::handlePointer() {
  const ImGuiIO& io = ImGui::GetIO();
  Input input;
  input.seconds = std::clamp(state_.time - last_time_, 0.0, 0.25);
  last_time_ = state_.time;
  input.shift = io.KeyShift;
  input.control = io.KeyCtrl;
  if (!dragDivider() && !io.WantCaptureMouse) {
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

// A cameras.json is no model: it replaces the cameras of the one shown.
void Viewer::openCameraFiles() {
  std::vector<std::filesystem::path>& requests = state_.documents.open_requests;
  const auto first = std::stable_partition(requests.begin(), requests.end(),
                                           [](const auto& path) { return path.extension() != ".json"; });
  const std::vector<std::filesystem::path> files(first, requests.end());
  requests.erase(first, requests.end());
  for (const std::filesystem::path& path : files) {
    try {
      openCameras(path);
    } catch (const Error& error) {
      state_.messages.error = error.what();
      state_.messages.notice_until = 0;
    }
  }
}

void Viewer::adopt(Scene scene) { setScene(state_, std::move(scene)); }

void Viewer::openCameras(const std::filesystem::path& path) {
  std::vector<Camera> cameras = readCameras(path);
  if (cameras.empty())
    throw Error(ErrorKind::badData, path.string(), "no camera inside (expected at least 1, found 0)");
  state_.scene.cameras = std::move(cameras);
  goToCamera(state_, startCamera(state_.scene.cameras));
  notify(state_, std::to_string(state_.scene.cameras.size()) + " cameras from " + path.filename().string());
}

// Of a whole picture: half of the area when two lie beside each other.
glm::ivec2 Viewer::pictureSize() const {
  glm::ivec2 size = pictureArea().size;
  if (state_.compare.how.mode == CompareMode::side) size.x = sideWidth(size.x);
  return size;
}

PictureRequest Viewer::request(glm::ivec2 size) const {
  std::string ignored;
  return {state_.scene.model, toCamera(state_.camera.pose, state_.camera.lens, size.x, size.y),
          effectiveSettings(state_), state_.display.output, otherPicture(ignored)};
}

std::optional<OtherPicture> Viewer::otherPicture(std::string& problem) const {
  const CompareState& compare = state_.compare;
  if (compare.how.mode == CompareMode::off) return std::nullopt;
  OtherPicture other;
  other.difference = compare.how.mode == CompareMode::difference;
  other.with_sign = compare.how.with_sign;
  other.gain = compare.how.gain;
  if (compare.with_photographs && photographs_) {
    if (state_.camera.index < 0) {
      problem = "No photograph was taken from here: go to a camera of the model (Space, or . and ,)";
      return std::nullopt;
    }
    other.taken = state_.scene.cameras[static_cast<std::size_t>(state_.camera.index)];
    other.photograph = photographs_->find(other.taken);
    if (!other.photograph.empty()) return other;
    problem = photographs_->folder().string() + ": holds no photograph \"" + other.taken.name + "\"";
    return std::nullopt;
  }
  const int document = otherDocument(state_);
  if (document >= 0) {
    other.model = state_.documents.open[static_cast<std::size_t>(document)].scene.model;
    if (other.model) return other;
  }
  problem = "There is nothing to compare with: open another model";
  return std::nullopt;
}

// Before the panels are drawn: what they say about the comparison.
void Viewer::updateComparison() {
  CompareState& compare = state_.compare;
  compare.problem.clear();
  (void)otherPicture(compare.problem);
  if (compare.problem.empty() && picture_ && asked_ && same(picture_->request, *asked_)) {
    compare.problem = picture_->problem;
  }
  if (compare.how.mode == CompareMode::flicker && compare.timed &&
      state_.time - flickered_ >= compare.flicker_seconds) {
    compare.how.shows_other = !compare.how.shows_other;
    flickered_ = state_.time;
  }
  if (const auto result = metrics_.take(); result && picture_ && result->pair == picture_->pair) {
    compare.metrics = result->metrics;
    compare.measured = true;
  }
}

// Only whole pictures are measured, each once.
void Viewer::measure() {
  CompareState& compare = state_.compare;
  if (!picture_ || !picture_->pair || !complete()) {
    compare.measured = false;
    if (compare.how.mode == CompareMode::off) compare.metrics.reset();
    return;
  }
  if (measured_ == picture_->pair) return;
  measured_ = picture_->pair;
  compare.measured = false;
  metrics_.ask(measured_);
}

// Numbers of the present picture are under way; scripts and captures wait for them.
bool Viewer::measuring() const { return picture_ && picture_->pair && complete() && !state_.compare.measured; }

// Near the line of a wipe the pointer moves it instead of the camera.
bool Viewer::dragDivider() {
  const ImGuiIO& io = ImGui::GetIO();
  Comparison& how = state_.compare.how;
  if (how.mode != CompareMode::wipe || !io.MouseDown[0]) return dragging_divider_ = false;
  const PixelRect area = pictureArea();
  const float pixels = std::max(io.DisplayFramebufferScale.x, 1e-3f);
  const float left = static_cast<float>(area.origin.x) / pixels, width = static_cast<float>(area.size.x) / pixels;
  if (!dragging_divider_) {
    const bool pressed = ImGui::IsMouseClicked(0) && !io.WantCaptureMouse;
    dragging_divider_ = pressed && std::abs(io.MousePos.x - (left + how.divider * width)) < kDividerReach;
  }
  if (dragging_divider_) {
    how.divider = std::clamp((io.MousePos.x - left) / width, 0.0f, 1.0f);
    frames_since_event_ = 0;
  }
  return dragging_divider_;
}

bool Viewer::complete() const {
  if (!state_.scene.model || given_up_) return true;
  return picture_ && same(picture_->request, request(pictureSize()));
}

void Viewer::askForPicture(bool moving) {
  if (!state_.scene.model) {
    picture_.reset();
    asked_.reset();
    return;
  }
  glm::ivec2 size = pictureSize();
  const bool reduced = moving && !capturing() && last_full_ms_ > kSmoothFrame;
  if (reduced) {
    const double scale = std::max(std::sqrt(kSmoothFrame / last_full_ms_), kSmallestScale);
    size = glm::max(glm::ivec2(glm::dvec2(size) * scale), glm::ivec2(1));
    frames_since_event_ = 0;  // the full picture is still owed
  }
  const PictureRequest wanted = request(size);
  const bool again = state_.ui.continuous && graphics_->pictures.idle();
  if (asked_ && same(*asked_, wanted) && !again) return;
  asked_ = wanted;
  given_up_ = false;
  graphics_->pictures.ask(wanted);
}

void Viewer::takePicture() {
  PictureThread::News news = graphics_->pictures.take();
  if (!news.problem.empty()) {
    if (script_ && news.given_up) throw Error(ErrorKind::device, news.problem);
    state_.messages.error = news.problem;
  }
  given_up_ = given_up_ || news.given_up;
  if (!news.picture) return;
  picture_ = std::move(news.picture);
  const glm::ivec2 size = picture_->image->size;
  statistics_.reduced = size != pictureSize();
  if (!statistics_.reduced) last_full_ms_ = picture_->milliseconds;
  statistics_.frame_ms.push_back(static_cast<float>(picture_->milliseconds));
  if (statistics_.frame_ms.size() > kFrameHistory) statistics_.frame_ms.erase(statistics_.frame_ms.begin());
  statistics_.passes = picture_->passes;
  statistics_.device = picture_->device;
  statistics_.picture_size = size;
  if (options_.timings && !timings_printed_) printTimings();
}

// From the start of the program to the pictures of the first model.
void Viewer::printTimings() {
  const double now = std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
  const double cpu = processMilliseconds() / 1e3;
  if (first_picture_ == 0) {
    first_picture_ = now;
    first_picture_cpu_ = cpu;
  }
  if (state_.scene.partial || picture_->request.model != state_.scene.model || statistics_.reduced) return;
  timings_printed_ = true;
  const double gigabytes = static_cast<double>(documents_.readBytes()) / 1e9;
  const double read = std::max(documents_.readSeconds(), 1e-9);
  std::printf("%s: %.1f MB read in %.2f s (%.2f GB/s)\n", state_.scene.path.c_str(), 1e3 * gigabytes, read,
              gigabytes / read);
  std::printf("first picture after %.2f s (%.2f s of CPU time), all of it after %.2f s (%.2f s, %.2f GB/s from disk)\n",
              first_picture_, first_picture_cpu_, now, cpu, gigabytes / now);
  std::fflush(stdout);
}

void Viewer::drawFrame() {
  // The window system may already have another size than the panels were laid out for.
  const ImGuiIO& io = ImGui::GetIO();
  const glm::ivec2 laid_out(std::lround(io.DisplaySize.x * io.DisplayFramebufferScale.x),
                            std::lround(io.DisplaySize.y * io.DisplayFramebufferScale.y));
  const VkCommandBuffer commands = graphics_->presenter.beginCommands();
  std::vector<PictureBlit> blits;
  if (picture_) blits = layOut(*picture_, state_.compare.how, pictureArea());
  graphics_->presenter.recordPictures(blits, kSurround);
  graphics_->presenter.beginPanels();
  if (laid_out == graphics_->presenter.size()) graphics_->gui.record(commands);
  graphics_->presenter.endPanels();
  graphics_->presenter.submitAndWait();
}

// As --render with the same comparison writes it.
Image Viewer::capturedPicture() {
  if (picture_->pair)
    return composed(picture_->pair->first, picture_->pair->other, picture_->pair->mask, state_.compare.how);
  return graphics_->presenter.read(picture_->image->storage.handle(), picture_->image->size);
}

void Viewer::writeCaptures() {
  const CaptureRequest capture = std::exchange(state_.capture, {});
  const auto saved = [this](const std::filesystem::path& path) {
    if (!script_) notify(state_, "Saved " + path.string());  // the next capture of a script must not show it
  };
  try {
    if (!capture.picture.empty()) {
      writeImage(capture.picture, capturedPicture());
      saved(capture.picture);
    }
    if (!capture.window.empty()) {
      writeImage(capture.window, graphics_->presenter.readWindow());
      saved(capture.window);
    }
    if (!capture.camera.empty()) {
      const glm::ivec2 size = pictureSize();
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
  // What is no model at all is said without a window.
  if (!options.follow) (void)detectFormat(options.model);
  std::unique_ptr<Viewer> viewer;
  try {
    viewer = std::make_unique<Viewer>(options);
  } catch (const Error& error) {
    // A broken file is the better news: it stays broken on a machine with a display.
    if (error.kind == ErrorKind::device && !options.follow) (void)readModel(options.model);
    throw;
  }
  viewer->run();
}

}  // namespace tg
