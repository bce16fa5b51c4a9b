// SPDX-License-Identifier: Apache-2.0
// Everything the viewer shows and lets one change. Panels, keys and scripts only write here; the window reads it.
#pragma once
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/renderer.h"
#include "viewer/camera_controller.h"

namespace tg {

// What the viewer keeps of a model once the renderer has its Gaussians.
struct Scene {
  std::filesystem::path path;
  std::vector<Camera> cameras;
  std::size_t gaussians = 0;
  std::size_t textured = 0;  // Gaussians with a texture rectangle
  std::size_t texels = 0;
  int sh_degree = 0;
  TextureMode texture_mode = TextureMode::none;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  glm::vec3 background{0.0f};
  std::vector<std::string> warnings;
  glm::dvec3 up{0, -1, 0};
  SceneBounds bounds;
  std::string training;  // how far its training is: "plain 1200 / 7000, 24.31 dB"; "" = not said
};

// What to write after the next complete frame. Empty paths: nothing.
struct CaptureRequest {
  std::filesystem::path picture;  // .png: the renderer's image alone
  std::filesystem::path window;   // .png: all that is on screen, panels included
  std::filesystem::path camera;   // .json: the picture's camera, for --camera
};

struct ViewerState {
  Scene scene;

  ViewPose pose;
  Lens lens;
  int camera = -1;   // the model's camera that the pose is; -1 once it has moved
  double speed = 1;  // [scene radii / s] of flying

  Output output = Output::final;
  RenderSettings settings;
  bool textures_held_off = false;  // the A/B key is down

  bool show_panel = true;
  bool show_help = false;
  bool continuous = false;  // draw without pause, to watch frame times
  std::string notice;       // a line that fades
  double notice_until = 0;  // [s] window time
  std::string error;        // shown until dismissed

  double aspect = 16.0 / 9.0;  // of the picture, written by the window
  double time = 0;             // [s] since the window opened, written by the window

  bool following = false;      // --follow
  int reloads = 0;             // models that --follow has brought
  std::string follow_problem;  // why there is no newer one; "" = none

  std::optional<std::filesystem::path> open_request;
  CaptureRequest capture;
  bool quit = false;
};

// What a frame is drawn with.
RenderSettings effectiveSettings(const ViewerState& state);

// A new model: its background, its first test camera (else its first camera, else all of it in view). Output, texture
// and intersection switches stay as they are.
void setScene(ViewerState& state, Scene scene);
// The same model, further trained: camera and background stay.
void replaceScene(ViewerState& state, Scene scene);
void goToCamera(ViewerState& state, int index);
void setCamera(ViewerState& state, const Camera& camera);  // any pose and lens, from a file for example
// The camera that setScene and --render start from; -1: the model has none.
int startCamera(std::span<const Camera> cameras);
void notify(ViewerState& state, std::string text);

enum class Action {
  final,
  base,
  texture,
  alpha,
  depth,
  normal,
  count,
  cycleTextures,
  toggleIntersection,
  frameScene,
  resetView,
  nextCamera,
  previousCamera,
  screenshot,
  windowShot,
  saveCamera,
  togglePanel,
  toggleHelp,
  quit,
};
void apply(ViewerState& state, Action action);

// One table feeds the keyboard and the help overlay. Keys are GLFW's numbers: ASCII for printable ones.
struct KeyBinding {
  int key = 0;
  bool shift = false;
  Action action = Action::quit;
  const char* keys = "";  // as the help shows it; "" = an alias that is not listed
  const char* text = "";
};
constexpr int kKeyEscape = 256;
constexpr int kKeyTab = 258;  // held: textures off
std::span<const KeyBinding> keyBindings();
std::optional<Action> actionOf(int key, bool shift);
// What the mouse and held keys do, for help and documentation: pairs of key and text.
struct HelpLine {
  const char* keys;
  const char* text;
};
std::span<const HelpLine> mouseHelp();

// What the pointer and held keys did since the last frame.
struct Input {
  glm::dvec2 drag{0.0};  // [px] right, down
  double wheel = 0;      // [notches] positive: away from the user
  bool left = false, middle = false, right = false;
  bool shift = false, control = false;
  glm::dvec3 fly{0.0};  // right, down, forward: -1, 0 or 1
  double roll = 0;      // -1, 0 or 1
  double seconds = 0;   // since the last frame
};
// Returns whether the camera moved. `height`: of the picture [px].
bool applyInput(ViewerState& state, const Input& input, int height);

// First name of the form stem-NNN.ext that is not taken in the working folder.
std::filesystem::path freeName(const std::string& stem, const std::string& extension);

}  // namespace tg
