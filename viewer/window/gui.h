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

  // A key of `events` that is up again by now is down in this frame.
  void beginFrame(const Events& events);
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

  GLFWwindow* window_;
  Screen& screen_;
  const float scale_;
  Fonts fonts_;
  std::vector<int> held_down_;  // keys that are down for a frame only
};

}  // namespace tg
