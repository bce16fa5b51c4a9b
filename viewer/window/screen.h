// SPDX-License-Identifier: Apache-2.0
// A window's device as the viewer sees it, whatever its API: what shows pictures and panels.
#pragma once
#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <memory>
#include <span>

#include "core/image/image.h"
#include "render/devices/devices.h"
#include "viewer/picture/device.h"
#include "viewer/view/options.h"

struct GLFWwindow;

namespace tg {

// [px] of the window, top left first.
struct PixelRect {
  glm::ivec2 origin{0};
  glm::ivec2 size{0};
};

// A part of an image and where in the window it goes.
struct PictureBlit {
  std::shared_ptr<const PictureImage> image;
  PixelRect from;
  PixelRect to;
};

// Pictures come from another thread, so that a frame is a few copies and the panels. Use: acquire, draw, read, present.
// None waits for the frame that it draws, but acquire for an earlier one: at most options.frames_in_flight are under
// way. All but the first four members belong to the window's thread.
class Screen {
 public:
  virtual ~Screen() = default;
  virtual bool software() const = 0;
  virtual int framesInFlight() const = 0;    // of the window and of the pictures
  virtual std::size_t messages() const = 0;  // of validation, so far
  virtual std::unique_ptr<PictureDevice> makePictureDevice() = 0;

  virtual glm::ivec2 size() const = 0;  // [px]
  // False: the window shows nothing now (minimised, or the window system takes no image); try again later.
  virtual bool acquire(glm::ivec2 framebuffer_size) = 0;
  // Clears the window, scales the pictures into it, in their order, and draws what ImGui::Render() left over them when
  // `panels`.
  virtual void draw(std::span<const PictureBlit> pictures, glm::vec3 clear, bool panels) = 0;
  virtual Image read(const PictureImage& image) = 0;
  // All that is on screen, between draw and present. Throws Error(device) where the window system forbids it.
  virtual Image readWindow() = 0;
  virtual void present() = 0;

  // Dear ImGui's back ends: once its context is there, at the start of a frame, before the context goes.
  virtual void startPanels() = 0;
  virtual void beginPanels() = 0;
  virtual void stopPanels() = 0;
};

// Gets a window's screen and returns the one to use: itself, or another one around it.
using ScreenWrapper = std::function<std::unique_ptr<Screen>(std::unique_ptr<Screen>)>;

// Whether pictures are textures that the window's context and the picture thread's share. Software devices cannot bear
// two such threads at once; their pictures go through memory.
enum class GlSharing : std::uint8_t { onHardware, always };

// For a window made for that API. Throw Error(device). Which device draws an OpenGL window is the window system's
// choice: another one than was picked is refused.
std::unique_ptr<Screen> makeVulkanScreen(GLFWwindow* window, const ViewOptions& options, const DevicePick& pick);
std::unique_ptr<Screen> makeGlScreen(GLFWwindow* window, const ViewOptions& options, const DevicePick& pick,
                                     GlSharing sharing = GlSharing::onHardware);

}  // namespace tg
