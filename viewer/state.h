// SPDX-License-Identifier: Apache-2.0
// Everything the viewer shows and lets one change. Panels, keys and scripts only write here; the window reads it.
#pragma once
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "render/renderer.h"
#include "viewer/camera_controller.h"
#include "viewer/compare.h"
#include "viewer/documents.h"
#include "viewer/scene.h"

namespace tg {

// Where the view is taken from.
struct CameraState {
  ViewPose pose;
  Lens lens;
  int index = -1;              // the model's camera that the pose is; -1 once it has moved
  double speed = 1;            // [scene radii / s] of flying
  double aspect = 16.0 / 9.0;  // of the picture, written by the window
};

// What is shown of the model, and how.
struct DisplayState {
  Output output = Output::final;
  RenderSettings settings;
  bool textures_held_off = false;  // the A/B key is down
};

struct UiState {
  bool panel = true;
  bool help = false;
  bool continuous = false;  // draw without pause, to watch frame times
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
};

// What to write after the next complete frame. Empty paths: nothing.
struct CaptureRequest {
  std::filesystem::path picture;  // .png: the renderer's image alone
  std::filesystem::path window;   // .png: all that is on screen, panels included
  std::filesystem::path camera;   // .json: the picture's camera, for --camera
};

// Failures that tests ask for; the window acts once and clears them.
struct TestState {
  bool lose_renderer = false;  // the next picture fails as on a lost device
  bool lose_window = false;    // the next frame of the window does
};

struct ViewerState {
  Scene scene;  // the one shown
  DocumentState documents;
  LoadState loading;
  CameraState camera;
  DisplayState display;
  CompareState compare;
  UiState ui;
  MessageState messages;
  FollowState follow;

  double time = 0;                  // [s] since the window opened, written by the window
  std::vector<std::string> recent;  // models opened before, the last one first; written by the window
  CaptureRequest capture;
  TestState test;
  bool quit = false;
};

// What a frame is drawn with.
RenderSettings effectiveSettings(const ViewerState& state);

// A new model: its background, its first test camera (else its first camera, else all of it in view). Output, texture
// and intersection switches stay as they are.
void setScene(ViewerState& state, Scene scene);
// The same model, further trained: camera and background stay.
void replaceScene(ViewerState& state, Scene scene);
// Back to the first view: the start camera, or all of the model.
void resetView(ViewerState& state);
void goToCamera(ViewerState& state, int index);
void setCamera(ViewerState& state, const Camera& camera);  // any pose and lens, from a file for example
// The camera that setScene and --render start from; -1: the model has none.
int startCamera(std::span<const Camera> cameras);
void notify(ViewerState& state, std::string text);

// First name of the form stem-NNN.ext that is not taken in the working folder.
std::filesystem::path freeName(const std::string& stem, const std::string& extension);

}  // namespace tg
