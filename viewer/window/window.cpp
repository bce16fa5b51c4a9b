// SPDX-License-Identifier: Apache-2.0
// The interactive viewer: GLFW window, events, and the frame loop.
#include "viewer/window/window.h"

#include <imgui.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include "converter/registry/file_format.h"
#include "core/bundle/camera_file.h"
#include "core/system/error.h"
#include "core/system/signals.h"
#include "viewer/model/open_models.h"
#include "viewer/panels/panels.h"
#include "viewer/panels/widgets.h"
#include "viewer/picture/inspector_thread.h"
#include "viewer/picture/runs.h"
#include "viewer/script/script.h"
#include "viewer/view/actions.h"
#include "viewer/view/edits.h"
#include "viewer/view/input.h"
#include "viewer/view/inspection.h"
#include "viewer/view/names.h"
#include "viewer/view/path_editor.h"
#include "viewer/view/state.h"
#include "viewer/window/captures.h"
#include "viewer/window/comparison_control.h"
#include "viewer/window/desktop_control.h"
#include "viewer/window/graphics.h"
#include "viewer/window/stop_signals.h"
#include "viewer/window/timings.h"
#include "viewer/window/window_session.h"

namespace tg {
namespace {

constexpr int kSettleFrames = 3;         // drawn after the last event: widgets answer a frame late
constexpr double kSmoothFrame = 30;      // [ms] a moving picture is drawn smaller when it takes longer than this
constexpr double kSmallestScale = 0.25;  // of that reduction, per side
constexpr double kHandleRest = 0.3;      // [s] without a move after which a dragged handle rests
constexpr double kProgressPause = 0.05;  // [s] between frames while a file is read
constexpr double kMotionPause = 0.008;   // [s] between frames while the camera moves by itself or pictures are made
constexpr double kDoubleClick = 0.4;     // [s] at most between its presses
constexpr double kStill = 3;             // [UiState::scale] a hand moves while it clicks
constexpr double kScriptPause = 0.02;    // [s] between looks at what a script waits for
constexpr int kOpeningFrames = 8;        // at most, that what is typed waits for a dialog
constexpr int kTrialFrames = 120;        // shown since the device failed, after which it may fail again

constexpr glm::vec3 kSurround(0.106f, 0.118f, 0.137f);  // the panel's colour, beside the picture

bool ofSameModels(const Picture& a, const Picture& b) {
  const auto other = [](const Picture& p) { return p.request.other ? p.request.other->model : nullptr; };
  return a.request.model == b.request.model && other(a) == other(b);
}

// Drags, holds a key or writes into a field.
bool userIsBusy() {
  const ImGuiIO& io = ImGui::GetIO();
  return io.WantTextInput || ImGui::IsAnyMouseDown() || std::ranges::any_of(io.KeysDown, std::identity());
}

// Pointer or keyboard did something since the frame before.
bool heardInput(const Events& events) {
  const ImGuiIO& io = ImGui::GetIO();
  const auto any = [](const auto& buttons) {
    return std::any_of(std::begin(buttons), std::end(buttons), std::identity());
  };
  return !events.taken.empty() || !io.InputQueueCharacters.empty() || io.MouseWheel != 0 || io.MouseDelta.x != 0 ||
         io.MouseDelta.y != 0 || any(io.MouseClicked) || any(io.MouseReleased);
}

class Viewer {
 public:
  Viewer(const ViewOptions& options, const WindowAdditions& additions);
  Viewer& operator=(Viewer&&) = delete;
  // Returns the signal that ended it, 0: none.
  int run();

 private:
  void waitForEvents();
  PixelRect pictureArea() const;
  void followAspect();
  void keepEdits(bool moving);
  void wishForLevels();
  bool handleMoves();
  bool awaitsField();
  bool inputQueued() const { return !events_.waiting.empty() || graphics_->gui.inputQueued(); }
  void handleEvents();
  void press(const InputEvent& key);
  void noticeShown();
  bool escapeForPanels();  // Esc was pressed, and press() has not taken it. Once a frame
  bool handlePointer();
  glm::dvec2 fromMiddle(glm::dvec2 place) const;
  void openCameraFiles();
  void inspectClick();
  bool scriptMayGoOn() const;
  void waitToBeShown(glm::ivec2 pixels);
  bool onDevice(const std::function<void()>& draw);
  bool timedOnDevice(const std::function<void()>& draw);

  void setTitle();
  void openJson(const std::filesystem::path& path);
  PictureRequest request(glm::ivec2 size) const;
  glm::ivec2 pictureSize() const;
  glm::ivec2 wantedSize() const { return drawnSize(state_, pictureSize()); }
  // Numbers of the present picture are under way; scripts and captures wait for them.
  bool measuring() const { return picture_ && hasFigures(*picture_) && measurable() && !state_.compare.measured; }
  // Of a model that is still coming there are no figures.
  bool measurable() const { return complete() && allThere(); }
  bool allThere() const { return state_.scene.streamed_from > 0 ? state_.stream.settled : !state_.scene.partial; }
  void ask(const PictureRequest& request);
  void askForPicture(bool moving);
  void runEnded();
  bool inspecting() const { return state_.inspect.asked || state_.inspect.busy; }
  bool ofScript(const std::function<bool()>& does) const;  // names the line of what fails
  void takePicture();
  void drawFrame();
  bool capturing() const { return !state_.capture.picture.empty() || !state_.capture.window.empty(); }
  // The pictures on screen are a recording's or a benchmark's, not those of the view.
  bool runDraws() const { return runs_.active() && !runs_.waitsFor(state_.scene); }
  // Levels are on their way that a script waits for.
  bool streaming() const { return script_ && !state_.stream.settled && !state_.loading.script_goes_on; }
  // The picture on screen is that of the present state at full size, or will never come. While the camera moves by
  // itself, any picture; to be saved, one at full size.
  bool complete() const;
  void capture();
  bool held(int key) const { return glfwGetKey(graphics_->window(), key) == GLFW_PRESS; }

  ViewOptions options_;
  const WindowAdditions additions_;
  std::optional<Script> script_;
  const std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
  WindowSession session_;
  Glfw glfw_;  // outlives every thread that wakes the window
  OpenModels documents_;
  ComparisonControl comparison_;
  StopSignals signals_{glfwPostEmptyEvent};
  Events events_;
  std::unique_ptr<Graphics> graphics_;
  ViewerState state_;
  FrameStatistics statistics_;
  std::optional<PictureRequest> asked_;     // last, of the picture thread
  std::shared_ptr<const Picture> picture_;  // on screen; null before the first
  bool given_up_ = false;                   // what was asked for cannot be drawn
  double last_full_ms_ = 0;                 // of the last picture at full size
  LoadTimings timings_{started_};
  FrameTimings frame_timings_;
  bool shown_any_ = false;               // a model
  std::string title_;                    // of the window
  int trial_ = 0;                        // frames before which the device may not fail again
  std::optional<double> refused_since_;  // [s] window time from which on the window system has taken no image
  std::size_t validation_messages_ = 0;  // of a device that has failed
  InspectorThread inspector_;
  DesktopControl desktop_;
  PictureRuns runs_;
  std::optional<InputEvent> last_press_;  // which another one makes a double click
  bool double_clicked_ = false;           // since the frame before
  int frames_since_event_ = 0;
  int chord_key_ = 0;          // was pressed with Ctrl, and is held
  int frames_awaited_ = 0;     // of a dialog's field
  int escapes_taken_ = 0;      // of which Dear ImGui may not have told yet
  glm::dvec2 handle_at_{0.0};  // [ImGui units] the pointer while it drags a handle
  double handle_moved_ = -1;   // [s] window time
  double last_time_ = 0;
};

Viewer::Viewer(const ViewOptions& options, const WindowAdditions& additions)
    : options_(options),
      additions_(additions),
      script_(options.script.empty() ? std::nullopt : std::optional(readScript(options.script, additions.verbs))),
      session_(options),
      documents_(
          options, glfwPostEmptyEvent,
          [this](ViewerState& state, Scene scene) { session_.adopt(state, std::move(scene)); }, additions.read,
          additions.wrap_levels),
      comparison_(options, glfwPostEmptyEvent),
      graphics_(std::make_unique<Graphics>(session_.windowSize(), events_, options, additions.wrap_screen)),
      desktop_(options, glfwPostEmptyEvent),
      runs_(options, started_, script_.has_value()) {
  session_.start(state_);
  if (state_.messages.error.empty()) state_.messages.error = comparison_.withoutPhotographs();
  if (script_) script_->error = state_.messages.error;
  if (!options.path.empty() && !options.benchmark) readPathFile(state_, options.path);
  state_.follow.active = options.follow;
  if (const std::optional<Photographs>& photographs = comparison_.photographs()) {
    state_.compare.photographs = photographs->folder();
    state_.compare.photographs_have_lens = photographs->haveLens();
    state_.compare.with_photographs = true;
  }
  state_.compare.other = options.compare;
  if (!options.compare.empty() || state_.compare.with_photographs) state_.compare.how.mode = options.compare_mode;
  state_.compare.how.gain = options.difference_gain;
  state_.record.fps = options.fps;
  state_.stream.budget = options.splat_budget.value_or(kUsualSplatBudget);
  setTitle();
}

void Viewer::setTitle() {
  const Scene& scene = state_.scene;
  shown_any_ = shown_any_ || !scene.path.empty();
  // What the command line names is the title until it is there.
  const std::filesystem::path& path = shown_any_ ? scene.path : options_.model;
  std::string title = "tgview";
  if (!path.empty()) title += " - " + path.filename().string();
  if (!state_.documents.open.empty() && hasUnsavedEdits(state_, state_.documents.shown)) title += "*";
  if (const std::string training = trainingText(state_); !training.empty()) title += " - " + training;
  if (title != title_) glfwSetWindowTitle(graphics_->window(), title.c_str());
  title_ = title;
}

int Viewer::run() {
  // A file that is being written may fail: the window ends after it, and after the run has been told to go on.
  while (!state_.quit || state_.desktop.saving || state_.follow.order) {
    waitForEvents();
    if (signals_.received() != 0) break;
    if (glfwWindowShouldClose(graphics_->window())) {
      glfwSetWindowShouldClose(graphics_->window(), GLFW_FALSE);
      script_ ? void(state_.quit = true) : askToQuit(state_);
    }
    glm::ivec2 pixels;
    glfwGetFramebufferSize(graphics_->window(), &pixels.x, &pixels.y);
    bool visible = false;
    if (!timedOnDevice([&] { visible = graphics_->screen().acquire(pixels); })) continue;
    if (!visible) {
      waitToBeShown(pixels);
      continue;
    }
    refused_since_.reset();
    state_.time = glfwGetTime();
    graphics_->gui.beginFrame(events_, awaitsField());
    state_.ui.scale = graphics_->gui.scale();
    if (heardInput(events_) || inputQueued()) frames_since_event_ = 0;
    followAspect();
    openCameraFiles();
    takePicture();
    if (state_.loading.part_owed) state_.loading.part_owed = state_.scene.partial && !complete();
    if (!script_ && guardEdits(state_)) frames_since_event_ = 0;
    wishForLevels();
    if (documents_.update(state_)) frames_since_event_ = 0;
    setTitle();
    if (ofScript([&] { return runs_.update(state_, pictureArea().size); })) runEnded();
    if (inspector_.update(state_, wantedSize())) frames_since_event_ = 0;
    if (desktop_.update(state_, graphics_->window(), pictureSize(), userIsBusy())) frames_since_event_ = 0;
    if (script_ && scriptMayGoOn()) {
      if (const auto size = step(*script_, state_)) glfwSetWindowSize(graphics_->window(), size->x, size->y);
    }
    handleEvents();
    const bool moving = handlePointer();
    comparison_.update(state_, picture_.get(), picture_ && asked_ && same(picture_->request, *asked_));
    drawPanels(state_, statistics_, escapeForPanels());
    keepEdits(moving);
    forEachName(state_, [this](std::string_view text) { graphics_->gui.want(text); });
    if (graphics_->gui.stale() || isFading()) frames_since_event_ = 0;
    graphics_->gui.endFrame();
    followAspect();
    askForPicture(moving || handleMoves());
    comparison_.measure(state_, picture_.get(), measurable());
    timedOnDevice([&] {
      drawFrame();
      if ((complete() && !measuring()) || !capturing()) capture();
      graphics_->screen().present();
      trial_ = std::max(0, trial_ - 1);
      noticeShown();
    });
    if (options_.timings) frame_timings_.frameShown();
  }
  if (options_.timings) frame_timings_.print();
  session_.keep(state_, desktop_.windowSize(graphics_->window()));
  validation_messages_ += graphics_->screen().messages();
  if (validation_messages_ > 0) {
    throw Error(ErrorKind::device, std::to_string(validation_messages_) + " validation messages (expected none)");
  }
  return signals_.received();
}

// For a window of so many pixels that shows nothing now.
void Viewer::waitToBeShown(glm::ivec2 pixels) {
  glfwWaitEventsTimeout(0.1);
  if (state_.quit) (void)desktop_.update(state_, graphics_->window(), pictureSize());
  if (pixels.x <= 0 || pixels.y <= 0) {  // until an event
    refused_since_.reset();
    return;
  }
  frames_since_event_ = 0;  // no event tells when the window system takes images again
  if (!refused_since_) refused_since_ = glfwGetTime();
  if ((!script_ && !options_.benchmark) || glfwGetTime() - *refused_since_ < additions_.patience) return;
  const Error refused(ErrorKind::device, "the window system takes no image (is the window hidden?)");
  if (script_) failAtLast(*script_, refused);
  throw refused;
}

// Runs what talks to the device outside of the picture thread. When that fails everything on the device is made anew,
// the window, too, with the CPU renderer; false then. Throws when it fails again before it has shown enough frames.
bool Viewer::onDevice(const std::function<void()>& draw) {
  try {
    draw();
    return true;
  } catch (const Error& error) {
    if (error.kind != ErrorKind::device || trial_ > 0) throw;
    trial_ = kTrialFrames;
    state_.messages.error = std::string("The device failed, the CPU renders from here on: ") + error.what();
    if (script_) script_->error = state_.messages.error;  // its pictures stay what they are
  }
  refused_since_.reset();
  validation_messages_ += graphics_->screen().messages();
  const PixelRect place = desktop_.leaveWindow(graphics_->window());
  runs_.forget();  // asked for again, of the new device
  picture_.reset();
  asked_.reset();
  graphics_.reset();
  ViewOptions options = options_;
  options.backend = Backend::cpu;
  options.device.clear();
  graphics_ = std::make_unique<Graphics>(place.size, events_, options, additions_.wrap_screen);
  glfwSetWindowPos(graphics_->window(), place.origin.x, place.origin.y);
  setTitle();
  frames_since_event_ = 0;
  return false;
}

bool Viewer::timedOnDevice(const std::function<void()>& draw) {
  const auto start = FrameTimings::Clock::now();
  const bool done = onDevice(draw);
  frame_timings_.held(FrameTimings::Clock::now() - start);
  return done;
}

bool Viewer::scriptMayGoOn() const {
  const DocumentState& documents = state_.documents;
  const bool asked =
      !documents.open_requests.empty() || hasCamerasDue(state_) || documents.show_request || documents.close_request;
  const bool loading = state_.loading.active && !state_.loading.script_goes_on;
  const bool saving = state_.desktop.saving || state_.desktop.save_request;
  const bool typed = inputQueued();
  return complete() && !measuring() && !capturing() && !asked && !loading && !saving && !typed;
}

// Sleeps while nothing changes: a still picture costs nothing. A finished picture is an event, and so is a model.
void Viewer::waitForEvents() {
  if (script_ && !scriptMayGoOn()) {
    glfwWaitEventsTimeout(kScriptPause);
  } else if (runs_.active() || movesByItself(state_) || state_.record.wanted || inspecting()) {
    glfwWaitEventsTimeout(kMotionPause);
  } else if (script_ || frames_since_event_ < kSettleFrames) {
    glfwPollEvents();
    ++frames_since_event_;
  } else if (state_.compare.how.mode == CompareMode::flicker && state_.compare.timed) {
    glfwWaitEventsTimeout(comparison_.untilFlicker(state_.compare, glfwGetTime()));
  } else if (state_.loading.active) {
    glfwWaitEventsTimeout(kProgressPause);
  } else {
    // A notice that must fade is the only thing that changes by itself.
    if (state_.time < state_.messages.notice_until) {
      glfwWaitEventsTimeout(state_.messages.notice_until - state_.time + 0.01);
    } else {
      glfwWaitEvents();
    }
    frames_since_event_ = 0;
  }
}

PixelRect Viewer::pictureArea() const {
  const ImGuiIO& io = ImGui::GetIO();
  const glm::ivec2 window = graphics_->screen().size();
  const float panel = panelWidth(state_, io.DisplaySize.x) * io.DisplayFramebufferScale.x;
  PixelRect area;
  area.origin.x = std::min(static_cast<int>(std::ceil(panel)), window.x - 1);
  area.size = window - area.origin;
  return area;
}

// Steps that can be undone, and the picture of a drag: a new one is made when the one before it is on screen.
void Viewer::keepEdits(bool moving) {
  const ImGuiIO& io = ImGui::GetIO();
  const bool held = io.MouseDown[0] || io.MouseDown[1] || io.MouseDown[2] || ImGui::IsAnyItemActive();
  if (!held) state_.edit.range_before.reset();
  if (sliderIsPutBack()) forgetLastStep(state_);
  recordChanges(state_, held || movesByItself(state_) || state_.edit.moving || state_.edit.selecting, moving);
  if (picture_ && picture_->request.model == shownModel(state_)) updatePreview(state_);
}

// A streamed scene has the levels of what is looked at, or of the picture that a recording waits for. One model more is
// made once the last one is on screen; what a recording draws need not be.
void Viewer::wishForLevels() {
  StreamState& stream = state_.stream;
  const int other = state_.compare.how.mode == CompareMode::off ? -1 : otherDocument(state_);
  const auto isStreamed = [](const Scene& scene) { return scene.streamed_from > 0; };
  const bool beside = other >= 0 && isStreamed(state_.documents.open[static_cast<std::size_t>(other)].scene);
  if (!isStreamed(state_.scene) && !beside) return;
  if (runDraws()) {
    if (const Camera* next = runs_.next()) stream.camera = *next;
    stream.drawn = true;
    return;
  }
  const glm::ivec2 size = wantedSize();
  stream.camera = toCamera(state_.camera.pose, state_.camera.lens, size.x, size.y);
  stream.drawn = picture_ && picture_->request.model == state_.scene.model;
}

// Whether a handle is dragged, and not held still.
bool Viewer::handleMoves() {
  const glm::dvec2 at(ImGui::GetIO().MousePos.x, ImGui::GetIO().MousePos.y);
  if (at != std::exchange(handle_at_, at)) handle_moved_ = state_.time;
  return state_.edit.moving && state_.time - handle_moved_ < kHandleRest;
}

// What is in view stays there when the window changes its shape.
void Viewer::followAspect() {
  const glm::ivec2 size = pictureSize();
  const double aspect = static_cast<double>(size.x) / size.y;
  if (aspect == state_.camera.aspect) return;
  reshape(state_, aspect);
}

// The field of a dialog that was asked for has no keyboard yet: what is typed is meant for it.
bool Viewer::awaitsField() {
  const DesktopState& desktop = state_.desktop;
  const bool opens = desktop.wanted || (desktop.dialog && !desktop.dialog->has_keyboard);
  frames_awaited_ = opens ? frames_awaited_ + 1 : 0;
  return opens && frames_awaited_ <= kOpeningFrames;
}

void Viewer::handleEvents() {
  if (const int chord = std::exchange(events_.chord, 0)) chord_key_ = chord;
  double_clicked_ = false;
  for (const InputEvent& event : events_.taken) {
    if (event.kind == InputEvent::Kind::key) press(event);
    if (event.kind != InputEvent::Kind::press || event.code != GLFW_MOUSE_BUTTON_LEFT) continue;
    const bool soon = last_press_ && event.time - last_press_->time < kDoubleClick;
    double_clicked_ = soon && glm::distance(*event.pointer, *last_press_->pointer) < kStill * state_.ui.scale;
    last_press_ = double_clicked_ ? std::nullopt : std::optional(event);
  }
  std::vector<std::filesystem::path>& requests = state_.documents.open_requests;
  const auto dropped = std::exchange(events_.dropped, {});
  requests.insert(requests.end(), dropped.begin(), dropped.end());
}

void Viewer::press(const InputEvent& key) {
  if (ImGui::GetIO().WantTextInput) return;
  if (isModal(state_) || state_.desktop.wanted || (key.code == kKeyEscape && popupIsOpen())) return;  // theirs
  if (key.code == kKeyEscape) ++escapes_taken_;
  pressKey(state_, key.code, key.shift, key.time);
}

// After a frame that was presented: what was pressed until then is taken up, as pressed before the notice was seen.
void Viewer::noticeShown() {
  if (!std::exchange(state_.ui.escape_said, false)) return;
  glfwPollEvents();
  state_.ui.escape_seen = glfwGetTime();
}

bool Viewer::escapeForPanels() {
  const bool pressed = escapePressed(), taken = pressed && escapes_taken_ > 0;
  if (taken) --escapes_taken_;
  if (!graphics_->gui.inputQueued()) escapes_taken_ = 0;
  return pressed && !taken;
}

bool Viewer::handlePointer() {
  const ImGuiIO& io = ImGui::GetIO();
  Input input;
  input.seconds = std::clamp(state_.time - last_time_, 0.0, 0.25);
  last_time_ = state_.time;
  input.shift = io.KeyShift;
  input.control = io.KeyCtrl;
  input.alt = io.KeyAlt;
  if (isModal(state_)) {
    cancelDrag(state_);
    return advance(state_, input.seconds);
  }
  const bool of_run = runDraws();  // what lies under the pointer then is another camera's
  if (of_run) cancelDrag(state_);
  const PointerTaken taken = of_run ? PointerTaken{} : editInput(state_);
  if (!of_run) inspectClick();
  if (!of_run && !taken.button && comparison_.dragDivider(state_, pictureArea())) {
    frames_since_event_ = 0;
  } else if (!io.WantCaptureMouse) {
    // The way to where a button went down is no drag.
    const bool pressed = io.MouseClicked[0] || io.MouseClicked[1] || io.MouseClicked[2];
    if (!pressed) input.drag = {io.MouseDelta.x, io.MouseDelta.y};
    input.wheel = taken.wheel ? 0 : io.MouseWheel;
    input.cursor = fromMiddle({io.MousePos.x, io.MousePos.y});
    input.left = io.MouseDown[0] && !taken.button;
    input.right = io.MouseDown[1];
    input.middle = io.MouseDown[2];
  }
  // With Ctrl they are chords, also when Ctrl is let go first.
  if (chord_key_ != 0 && !held(chord_key_)) chord_key_ = 0;
  if (!io.WantTextInput && !io.KeyCtrl && chord_key_ == 0) {
    const auto axis = [this](int positive, int negative) { return held(positive) - held(negative); };
    input.fly = {axis(GLFW_KEY_D, GLFW_KEY_A), axis(GLFW_KEY_Q, GLFW_KEY_E), axis(GLFW_KEY_W, GLFW_KEY_S)};
    input.roll = axis(GLFW_KEY_X, GLFW_KEY_Z);
    input.arrows = {axis(GLFW_KEY_RIGHT, GLFW_KEY_LEFT), axis(GLFW_KEY_UP, GLFW_KEY_DOWN)};
  }
  if (!script_) state_.display.textures_held_off = !io.WantTextInput && held(kKeyTab);
  const double units_high = static_cast<float>(pictureArea().size.y) / std::max(io.DisplayFramebufferScale.y, 1e-3f);
  const bool moved = applyInput(state_, input, static_cast<int>(units_high));
  const bool advanced = advance(state_, input.seconds);
  const bool active =
      moved || advanced || input.fly != glm::dvec3(0.0) || input.roll != 0 || input.arrows != glm::dvec2(0.0);
  if (active) frames_since_event_ = 0;
  return active;
}

// A click that was no drag, with Alt or while clicks inspect; else two of them set the pivot.
void Viewer::inspectClick() {
  const ImGuiIO& io = ImGui::GetIO();
  const bool inspects = io.KeyAlt || state_.inspect.active;
  const double still = kStill * state_.ui.scale;
  if (io.WantCaptureMouse || double{io.MouseDragMaxDistanceSqr[0]} > still * still) return;
  if (inspects ? !ImGui::IsMouseReleased(0) : !double_clicked_ || hasButton(state_.edit)) return;
  glm::dvec2 at = glm::dvec2(io.MousePos.x, io.MousePos.y) *
                      glm::dvec2(io.DisplayFramebufferScale.x, io.DisplayFramebufferScale.y) -
                  glm::dvec2(pictureArea().origin);
  if (at.x >= pictureSize().x) at.x -= pictureSize().x;  // the right one of two
  const glm::ivec2 pixel(glm::floor(at / glm::dvec2(pictureSize()) * glm::dvec2(wantedSize())));
  if (glm::all(glm::greaterThanEqual(pixel, glm::ivec2(0))) && glm::all(glm::lessThan(pixel, wantedSize()))) {
    inspects ? inspect(state_, pixel) : void(state_.desktop.turn_about = pixel);
  }
}

// [ImGui units] right and down of the middle of the picture that a place of the window lies on.
glm::dvec2 Viewer::fromMiddle(glm::dvec2 place) const {
  const ImGuiIO& io = ImGui::GetIO();
  const glm::dvec2 scale(std::max(io.DisplayFramebufferScale.x, 1e-3f), std::max(io.DisplayFramebufferScale.y, 1e-3f));
  const glm::dvec2 size = glm::dvec2(pictureSize()) / scale;
  glm::dvec2 at = place - glm::dvec2(pictureArea().origin) / scale;
  if (at.x >= size.x) at.x -= size.x;  // the right one of two
  return at - 0.5 * size;
}

// A .json is no model: a camera path, or cameras that replace the cameras of the one shown.
void Viewer::openCameraFiles() {
  for (const std::filesystem::path& path : takeCameraFiles(state_)) attempt(state_, [&] { openJson(path); });
}

void Viewer::openJson(const std::filesystem::path& path) {
  if (isPathFile(path)) {
    state_.ui.tab = Tab::path;
    return loadPath(state_, path);
  }
  std::vector<Camera> cameras = readCameras(path);
  if (cameras.empty()) {
    throw Error(ErrorKind::badData, path.string(), "no camera inside (expected at least 1, found 0)");
  }
  replaceCameras(state_, std::move(cameras));
  const std::size_t count = state_.scene.cameras.size();
  notify(state_, std::to_string(count) + (count == 1 ? " camera" : " cameras") + " from " + path.filename().string());
}

// Of a whole picture: half of the area when two lie beside each other.
glm::ivec2 Viewer::pictureSize() const {
  glm::ivec2 size = pictureArea().size;
  if (state_.compare.how.mode == CompareMode::side) size.x = sideWidth(size.x);
  return size;
}

PictureRequest Viewer::request(glm::ivec2 size) const {
  ComparisonControl::Problem ignored;
  return {shownModel(state_), toCamera(state_.camera.pose, state_.camera.lens, size.x, size.y),
          effectiveSettings(state_), state_.display.output, comparison_.other(state_, ignored)};
}

bool Viewer::complete() const {
  if (inspecting() || streaming()) return false;
  if (!state_.scene.model || given_up_) return true;
  if (runDraws()) return picture_ != nullptr;  // no picture is the last one
  if (movesByItself(state_)) return picture_ && (!capturing() || picture_->image->size == wantedSize());
  return picture_ && same(picture_->request, request(wantedSize()));
}

// What was asked for last was the run's.
void Viewer::runEnded() {
  asked_.reset();
  frames_since_event_ = 0;
}

void Viewer::ask(const PictureRequest& request) {
  asked_ = request;
  given_up_ = false;
  graphics_->pictures.ask(request);
}

void Viewer::askForPicture(bool moving) {
  if (!state_.scene.model) {
    if (!picture_ && !asked_) return;
    picture_.reset();
    asked_.reset();
    graphics_->pictures.tidy();
    return;
  }
  if (runDraws()) {
    if (runs_.streams()) {
      const Camera* next = runs_.next();
      if (!next || !state_.stream.settled || static_cast<const Pinhole&>(*next) != state_.stream.camera) return;
    }
    if (const auto due = runs_.due(request(pictureArea().size))) ask(*due);
    return;
  }
  glm::ivec2 size = wantedSize();
  const bool reduced = moving && !capturing() && last_full_ms_ > kSmoothFrame;
  if (reduced) {
    const double scale = std::max(std::sqrt(kSmoothFrame / last_full_ms_), kSmallestScale);
    size = glm::max(glm::ivec2(glm::dvec2(size) * scale), glm::ivec2(1));
    frames_since_event_ = 0;  // the full picture is still owed
  }
  const PictureRequest wanted = request(size);
  const bool again = state_.ui.continuous && !graphics_->pictures.waiting();
  if (asked_ && same(*asked_, wanted) && !again) return;
  ask(wanted);
}

bool Viewer::ofScript(const std::function<bool()>& does) const {
  try {
    return does();
  } catch (const Error& error) {
    if (script_) failAtLast(*script_, error);
    throw;
  }
}

void Viewer::takePicture() {
  PictureThread::News news = graphics_->pictures.take();
  if (!news.problem.empty()) {
    if (script_ && news.given_up) throw Error(ErrorKind::device, news.problem);
    state_.messages.error = news.problem;
    if (script_) script_->error = news.problem;
  }
  given_up_ = given_up_ || news.given_up;
  if (news.given_up && runs_.active()) {
    runs_.giveUp(state_, news.problem);
    runEnded();
  }
  if (!news.picture) return;
  const bool of_others = picture_ && !ofSameModels(*picture_, *news.picture);
  picture_ = std::move(news.picture);
  if (of_others) graphics_->pictures.tidy();  // one of them may be closed
  state_.display.scale = picture_->scale;
  state_.display.scaled = picture_->request.output;
  if (options_.timings) frame_timings_.pictureArrived();
  const glm::ivec2 size = picture_->image->size;
  const bool for_run = ofScript(
      [&] { return runs_.take(state_, *picture_, [&] { return graphics_->screen().read(*picture_->image); }); });
  if (for_run && !runs_.active()) runEnded();
  statistics_.reduced = !for_run && size != wantedSize();
  if (!statistics_.reduced && !for_run) last_full_ms_ = picture_->milliseconds;
  statistics_.frame_ms.push_back(static_cast<float>(picture_->milliseconds));
  if (statistics_.frame_ms.size() > kFrameHistory) statistics_.frame_ms.erase(statistics_.frame_ms.begin());
  statistics_.passes = picture_->passes;
  statistics_.device = picture_->device;
  statistics_.picture_size = size;
  if (options_.timings) {
    const bool there = allThere();
    const bool whole = there && picture_->request.model == state_.scene.model && !statistics_.reduced;
    timings_.take(whole, state_.scene, documents_);
  }
}

void Viewer::drawFrame() {
  // The window system may already have another size than the panels were laid out for.
  const ImGuiIO& io = ImGui::GetIO();
  const glm::ivec2 laid_out(std::lround(io.DisplaySize.x * io.DisplayFramebufferScale.x),
                            std::lround(io.DisplaySize.y * io.DisplayFramebufferScale.y));
  std::vector<PictureBlit> blits;
  if (picture_ && runDraws()) {
    const glm::ivec2 size = picture_->image->size;
    blits.push_back({picture_->image, {{0, 0}, size}, fittedInto(pictureArea(), size)});
  } else if (picture_) {
    blits = layOut(*picture_, state_.compare.how, pictureArea());
  }
  graphics_->screen().draw(blits, kSurround, laid_out == graphics_->screen().size());
}

void Viewer::capture() {
  try {
    const std::filesystem::path saved = writeCaptures(state_, picture_.get(), pictureSize(), graphics_->screen());
    if (saved.empty() || script_) return;  // a script's next picture must not show it
    notify(state_, "Saved " + absolutePath(saved).string());
  } catch (const Error& error) {
    if (script_) failAtLast(*script_, error);
    sayNotWritten(state_, std::exchange(state_.capture.dialog, std::nullopt), error.what());
    frames_since_event_ = 0;
  }
}

}  // namespace

void runWindow(const ViewOptions& options, const WindowAdditions& additions) {
  // What is no model at all is said without a window.
  const bool names_file = !options.follow && !options.model.empty();
  if (names_file && !isLodMeta(options.model)) (void)detectFormat(options.model);
  std::unique_ptr<Viewer> viewer;
  try {
    viewer = std::make_unique<Viewer>(options, additions);
  } catch (const Error& error) {
    // A broken file is the better news: it stays broken on a machine with a display.
    if (error.kind == ErrorKind::device && names_file) {
      isLodMeta(options.model) ? (void)openLevels(options.model, {}) : (void)readModel(options.model);
    }
    throw;
  }
  const int signal = viewer->run();
  viewer.reset();  // what is being saved is there then
  if (signal != 0) endAtOnce(signal);
}

}  // namespace tg
