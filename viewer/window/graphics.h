// SPDX-License-Identifier: Apache-2.0
// A window with everything that lives on its device, and where pictures lie in it.
#pragma once
#include <memory>
#include <vector>

#include "viewer/picture/thread.h"
#include "viewer/window/glfw.h"
#include "viewer/window/gui.h"
#include "viewer/window/screen.h"

namespace tg {

struct OpenedScreen {
  WindowPtr window;
  std::unique_ptr<Screen> screen;  // first to end
  std::string backend;             // what renders, as --backend has it
};

// Made anew as a whole when the device fails.
struct Graphics {
  // Opens a window of `size` for the first API that --backend and --device allow: one whose device is a GPU if there is
  // any, else one that shows what the CPU renders. Its screen goes through `wrap`, which may be empty. Throws Error:
  // device, usage.
  Graphics(glm::ivec2 size, Events& events, const ViewOptions& options, const ScreenWrapper& wrap);

  GLFWwindow* window() const { return opened.window.get(); }
  Screen& screen() const { return *opened.screen; }

  OpenedScreen opened;
  Gui gui;
  PictureThread pictures;  // first to end
};

// The largest rectangle of the shape of `size` in the middle of `area`.
PixelRect fittedInto(PixelRect area, glm::ivec2 size);

// The picture and, where there is one, what it is compared with. Those of another shape than their place, of a window
// or a mode before, are fitted into it.
std::vector<PictureBlit> layOut(const Picture& picture, const Comparison& how, PixelRect area);

}  // namespace tg
