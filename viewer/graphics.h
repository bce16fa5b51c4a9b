// SPDX-License-Identifier: Apache-2.0
// Everything of a window that lives on a device, and where pictures lie in it.
#pragma once
#include <memory>
#include <vector>

#include "viewer/glfw_window.h"
#include "viewer/gui.h"
#include "viewer/picture_thread.h"
#include "viewer/presenter.h"

namespace tg {

// Made anew as a whole when the device fails.
struct Graphics {
  // Throws Error(device).
  Graphics(GLFWwindow* window, const ViewOptions& options);

  std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> device;
  Presenter presenter;
  Gui gui;
  PictureThread pictures;  // first to end
};

// The picture and, where there is one, what it is compared with.
std::vector<PictureBlit> layOut(const Picture& picture, const Comparison& how, PixelRect area);

}  // namespace tg
