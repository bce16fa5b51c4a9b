// SPDX-License-Identifier: Apache-2.0
// Everything the viewer shows and lets one change. Panels, keys and scripts only write here; the window reads it.
#pragma once
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/run/live.h"
#include "core/system/names.h"
#include "render/reference/inspect.h"
#include "render/renderer.h"
#include "viewer/view/camera_controller.h"
#include "viewer/view/camera_path.h"
#include "viewer/view/compare.h"
#include "viewer/view/desktop.h"
#include "viewer/view/documents.h"
#include "viewer/view/edit_state.h"
#include "viewer/view/history.h"
#include "viewer/view/options.h"
#include "viewer/view/scene.h"

namespace tg {

// Where the view is taken from.
struct CameraState {
  ViewPose pose;
  Lens lens;
  int index = -1;              // the model's camera that the pose is; -1 once it has moved
  int visited = -1;            // the one that it was before it moved
  double speed = 1;            // [scene radii / s] of flying
  double aspect = 16.0 / 9.0;  // of the picture, written by the window

  bool fly = false;  // dragging with the left button looks around instead of orbiting
  UpAxis up = UpAxis::cameras;
  bool turntable = false;                        // turns around the pivot by itself
  double turntable_speed = 0.5;                  // [rad / s] counter-clockwise
  std::vector<Camera> bookmarks;                 // of this model, with their names
  int bookmark = -1;                             // the one visited last
  std::string bookmark_file = "bookmarks.json";  // what the panel saves to and loads from
};

// The camera path: its keys, and where it is played.
struct PathState {
  CameraPath path;
  bool playing = false;
  double at = 0;                   // [s] since the first key
  int key = -1;                    // the key that was shown or added last; -1: none
  double key_seconds = 2;          // [s] to a new key
  bool drawn = true;               // as lines in the scene
  std::string file = "path.json";  // what the panel saves to and loads from
};

// A recording in the window. Panels, keys and scripts set what is wanted; the window writes how far it is.
struct RecordState {
  std::filesystem::path out = "recording.mp4";
  glm::ivec2 size{1280, 720};  // [px]
  double fps = 30;
  int turntable_frames = 120;  // of a turn, where there is no path
  bool wanted = false;         // set to begin, cleared to cancel; the window clears it at the end
  bool waits = false;          // for its streamed scene to be shown again
  std::size_t done = 0, frames = 0;

  // The pictures on screen are its own, of other cameras than the view's, and of no comparison.
  bool draws() const { return wanted && !waits; }
};
constexpr double kMinFps = 0.1, kMaxFps = 1000;  // of recordings [1 / s]

// What the list of a pixel's splats is sorted by. order: front to back, as they are blended.
enum class HitColumn { order, index, depth, weight, alpha, opacity, size };

// What lies under a pixel. Panels, keys and scripts ask; the window answers.
struct InspectState {
  bool active = false;              // a click on the picture inspects
  std::optional<glm::ivec2> asked;  // [px] of the picture; not taken up yet
  bool busy = false;                // being answered
  bool inspected = false;           // what follows is of a pixel
  glm::ivec2 pixel{0};              // [px]
  Camera camera;                    // of the picture that it was a pixel of
  std::vector<PixelHit> hits;       // front to back
  int picked = -1;                  // of hits
  bool seek = false;                // the list is to show it
  HitColumn sorted_by = HitColumn::order;
  bool descending = false;
  bool isolated = false;  // the picked Gaussian alone is to be drawn
};

// What is shown of the model, and how.
struct DisplayState {
  Output output = Output::final;
  RenderSettings settings;          // all but outputs and crop, which effectiveSettings fills in
  bool textures_held_off = false;   // the A/B key is down
  bool crop = false;                // only what lies in the box is drawn
  CropBox box;                      // world; shown as lines while it crops
  std::optional<ValueScale> scale;  // of the picture on screen, where it has one; written by the window
  Output scaled = Output::final;    // what that picture shows, likewise
  double resolution = 1;  // of the picture, per side and pixel of the window: kMinResolution to kMaxResolution
};
constexpr int kMaxImageSide = 16384;  // [px] what Vulkan devices offer
constexpr double kMinResolution = 0.1, kMaxResolution = 2;

// The pages of the panel.
enum class Tab { view, camera, path, inspect, edit, time };
constexpr auto namesOf(Tab) { return enumNames("view", "camera", "path", "inspect", "edit", "time"); }

constexpr double kLeastPanel = 19, kUsualPanel = 21, kMostPanel = 60;  // [font heights] of its width

struct UiState {
  bool panel = true;
  double panel_width = kUsualPanel;  // [font heights]
  double scale = 1;                  // [ImGui units] of what one is at 96 dpi; written by the window
  Tab tab = Tab::view;
  bool help = false;
  bool help_scrolls = false;  // it has more lines than the window room; written by the panels
  int help_pages = 0;         // that it is still to be scrolled down by
  bool menu = false;          // the menu bar lies over the picture: the pointer has come for it, the panel is hidden
  bool continuous = false;    // draw without pause, to watch frame times
  double key_time = 0;        // [s] window time: when the key was taken up that acts
  bool escape_said = false;   // that Esc once more quits, by a notice that is still to be shown
  double escape_seen = -1e9;  // [s] window time: since the window shows it
  bool drag_spent = false;    // the left button is down for a drag that was taken back: it does nothing until let go
};

struct MessageState {
  std::string notice;       // a line that fades
  double notice_until = 0;  // [s] window time
  std::string error;        // shown until dismissed
};

// --follow
struct FollowState {
  bool active = false;
  int reloads = 0;      // models that it has brought
  std::string problem;  // why there is no newer one; "" = none
  bool waits = false;   // newer ones would take away what is being chosen or dragged
  // Of a run's folder.
  std::shared_ptr<const std::vector<RunMetrics>> lines;  // its metrics.jsonl; may be null
  std::optional<RunStatus> status;                       // none: nothing trains there
  std::optional<RunOrder> order;                         // to be given to it
  std::optional<RunCommand> told;                        // by this window, last
};

// The scene shown, where it is streamed (Scene::streamed_from). The window writes all but the budget.
struct StreamState {
  std::size_t budget = kUsualSplatBudget;  // Gaussians drawn, at most
  Camera camera;                           // that the levels are chosen for
  bool drawn = false;                      // the model that came last is on screen
  bool settled = false;                    // it has the levels that the camera asks for, as far as they can be read
  std::size_t owed = 0;                    // files of chunks on their way
  std::size_t lost = 0;                    // files of chunks that cannot be read
  std::string loading;                     // the chunks being read; "" = none
};

// What to write after the next complete frame. Empty paths: nothing.
struct CaptureRequest {
  std::filesystem::path picture;     // .png: the renderer's image alone
  std::optional<FileDialog> dialog;  // that it was chosen in
  std::filesystem::path window;      // .png: all that is on screen, panels included
  std::filesystem::path camera;      // .json: the picture's camera, for --camera
};

struct ViewerState {
  Scene scene;  // the one shown
  DocumentState documents;
  LoadState loading;
  CameraState camera;
  PathState path;
  RecordState record;
  InspectState inspect;
  DisplayState display;
  CompareState compare;
  EditState edit;
  History history;
  UiState ui;
  MessageState messages;
  FollowState follow;
  StreamState stream;
  DesktopState desktop;

  double time = 0;                  // [s] since the window opened, written by the window
  std::vector<std::string> recent;  // models opened before, the last one first; written by the window
  CaptureRequest capture;
  bool quit = false;
};

glm::dvec3 upOf(const ViewerState& state);  // what the horizon is kept by
bool isIsolated(const ViewerState& state);  // the picked Gaussian alone is drawn
// What a frame is drawn with.
RenderSettings effectiveSettings(const ViewerState& state);
// The same settings, but with what they leave to the model.
RenderSettings shownSettings(const ViewerState& state, RenderSettings settings);

// The picture's size on an area of the window, at most kMaxImageSide a side.
glm::ivec2 drawnSize(const ViewerState& state, glm::ivec2 area);
// The crop box around all means, or around the middle of them: what lies outside of it along an axis is 1 % either way.
void resetCrop(ViewerState& state);
void fitCrop(ViewerState& state);

// A new model: its background, its first test camera (else its first camera, else all of it in view). Output, texture
// and intersection switches stay as they are.
void setScene(ViewerState& state, Scene scene);
// The same model, further trained: camera and background stay.
void replaceScene(ViewerState& state, Scene scene);
// Back to the first view: the start camera, or all of the model.
void resetView(ViewerState& state);
// The view is no camera of the model any more.
void leaveCamera(CameraState& camera);
// The model's camera at whose place the view is, through whatever lens; -1: none.
int cameraHere(const ViewerState& state);
// The model's camera that the view is or was last; -1: none.
int lastCamera(const ViewerState& state);
void goToCamera(ViewerState& state, int index);
// The model's camera of that number, or a cameras.json's first. `what` names it in errors. Throws what cameraOf()
// throws.
void goToCamera(ViewerState& state, const std::string& text, const std::string& what);
// The cameras of a file instead of those of the model shown, at least one; to the first of them, as in resetView().
void replaceCameras(ViewerState& state, std::vector<Camera> cameras);
void setCamera(ViewerState& state, const Camera& camera);  // any pose and lens, from a file for example
// The camera that setScene and --render start from; -1: the model has none.
int startCamera(std::span<const Camera> cameras);
// What the notice before said of Esc holds no longer, in both.
void notify(ViewerState& state, std::string text);
void endNotice(ViewerState& state);
// Shows what an action throws as the viewer's error.
void attempt(ViewerState& state, const std::function<void()>& action);

// First name of the form stem-NNN.ext that is not taken in the working folder.
std::filesystem::path freeName(const std::string& stem, const std::string& extension);

}  // namespace tg
