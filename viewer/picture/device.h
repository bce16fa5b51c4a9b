// SPDX-License-Identifier: Apache-2.0
// A device that pictures are drawn on, whatever its API.
#pragma once
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "core/image/image.h"
#include "render/devices/devices.h"
#include "viewer/view/options.h"

namespace tg {

// RGBA8 on the device, all writes finished.
class PictureImage {
 public:
  virtual ~PictureImage() = default;
  const glm::ivec2 size;  // [px]

 protected:
  explicit PictureImage(glm::ivec2 s) : size(s) {}
};

// Makes pictures, all in the thread that made it, which also destroys it. Images may be destroyed in another thread,
// too. Throws Error(device), std::bad_alloc; drawing DoesNotFit, after which fewer rows of the picture may be drawn.
class PictureDevice {
 public:
  virtual ~PictureDevice() = default;
  virtual std::shared_ptr<PictureImage> makeImage(glm::ivec2 size) = 0;
  virtual std::unique_ptr<GpuRenderer> makeRenderer() = 0;
  // One of its renderers into the rows of an image from `top` on, as many as the request's camera has; those above them
  // stay. Returns as GpuRenderer::draw().
  virtual bool draw(GpuRenderer& renderer, const FrameRequest& request, PictureImage& target, int top) = 0;
  // A whole picture in two steps, so that the next picture is recorded while the device draws this one. begin(): false
  // when this one must be drawn alone; nothing has happened then. finish() waits at most so long [ms] for the oldest
  // that was begun, none: it has not ended; else as draw(). Nothing else may be called while one is under way.
  virtual bool begin(GpuRenderer&, const FrameRequest&, const std::shared_ptr<PictureImage>&) { return false; }
  virtual std::optional<bool> finish(double) { return std::nullopt; }
  // Waits for all that were begun, and forgets them.
  virtual void drain() noexcept {}
  virtual void upload(const Image& picture, PictureImage& target) = 0;  // 3 channels in [0, 1]
  virtual Image download(const PictureImage& source) = 0;               // 3 channels
};

// The APIs that --backend and --device leave, the first choice first; none for the CPU. Throws Error(usage) when they
// contradict each other.
std::vector<Api> apisFor(const ViewOptions& options, const DevicePick& pick);

}  // namespace tg
