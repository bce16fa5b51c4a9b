// SPDX-License-Identifier: Apache-2.0
// Every widget of the viewer. Panels read the statistics and change the state, nothing else.
#pragma once
#include <string>
#include <vector>

#include "viewer/view/edit_pointer.h"
#include "viewer/view/state.h"

namespace tg {

// What a frame cost, for display.
struct FrameStatistics {
  std::vector<float> frame_ms;   // wall time of the last drawn frames, oldest first
  std::vector<PassTime> passes;  // of the last frame that was drawn anew
  std::string device;
  glm::ivec2 picture_size{0};  // [px]
  bool reduced = false;        // the picture is drawn smaller while the camera moves
};

constexpr std::size_t kFrameHistory = 120;

// Width of the panel [ImGui units]; 0 while it is hidden or the window is too narrow to give it room of its own.
float panelWidth(const ViewerState& state, float window_width);

// Where the picture lies in the window, and its camera, in ImGui's units; of two beside each other, the left one.
struct PictureOnScreen {
  Camera camera;
  glm::vec2 corner{0.0f};
  float scale = 1;  // UiState::scale
};
PictureOnScreen pictureOnScreen(const ViewerState& state);
// What of the pointer is an edit tool's, not the camera's; a tool is at work in either of two pictures beside each
// other. Once a frame, before drawPanels().
PointerTaken editInput(ViewerState& state);

// Whether a list or the colour picker is open: Esc is theirs then.
bool popupIsOpen();

// Whether what lies behind a dialog is still getting darker or brighter, or a hint is to come.
bool isFading();

// Whether Esc went down. Later versions of Dear ImGui tell of each press of a frame in a frame of its own.
bool escapePressed();

// escape: it was pressed, and nobody else took it; the innermost list or a dialog closes.
void drawPanels(ViewerState& state, const FrameStatistics& statistics, bool escape);

}  // namespace tg
