// SPDX-License-Identifier: Apache-2.0
// Dear ImGui's context for one window: fonts, colours, life and death. No widgets here.
#pragma once
#include <string_view>
#include <vector>

#include "viewer/window/fonts.h"
#include "viewer/window/screen.h"

struct GLFWwindow;

namespace tg {

struct Events;

class Gui {
 public:
  // Callbacks that the window has set before keep being called.
  Gui(GLFWwindow* window, Screen& screen);
  ~Gui();
  Gui& operator=(Gui&&) = delete;

  // Takes of `events` what the frame may have; nothing where it `waits`. Pointer, buttons and keys are as they were at
  // that, whatever they are by now.
  void beginFrame(Events& events, bool waits);
  // Keys and clicks are left for the frames to come: later versions of Dear ImGui take what would be lost within one
  // frame, the letters of a word that is typed fast, one after the other.
  bool inputQueued() const;
  // Asks for the letters of a text, which are there a frame later.
  void want(std::string_view text) { fonts_.want(text); }
  bool stale() const { return fonts_.stale(); }
  double scale() const { return scale_; }  // UiState::scale
  void endFrame();  // no widgets after this; Screen::draw() shows them

 private:
  void end();
  void newFrame(Events& events, bool waits);

  GLFWwindow* window_;
  Screen& screen_;
  const float scale_;
  Fonts fonts_;
  std::vector<int> told_keys_;  // of this frame, as they were not by its end
  double pressed_at_ = -1;      // [s] of GLFW's clock: the left button, last
};

}  // namespace tg
