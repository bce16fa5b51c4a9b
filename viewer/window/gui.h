// SPDX-License-Identifier: Apache-2.0
// Dear ImGui's context for one window: fonts, colours, life and death. No widgets here.
#pragma once
#include "viewer/window/screen.h"

struct GLFWwindow;

namespace tg {

class Gui {
 public:
  // Callbacks that the window has set before keep being called.
  Gui(GLFWwindow* window, Screen& screen);
  ~Gui();
  Gui& operator=(Gui&&) = delete;

  void beginFrame();
  void endFrame();  // no widgets after this; Screen::draw() shows them

 private:
  Screen& screen_;
};

}  // namespace tg
