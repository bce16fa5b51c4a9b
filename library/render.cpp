// SPDX-License-Identifier: Apache-2.0
// Pictures, by the CPU renderer.
#include "textured_gaussians/render.h"

#include <mutex>

#include "core/system/parallel.h"
#include "library/access.h"
#include "render/renderer.h"

namespace textured_gaussians {
namespace {

static_assert(static_cast<int>(Output::depthMedian) == static_cast<int>(tg::Output::depthMedian));

constexpr int kMostThreads = 1024;  // as many as the programs take

}  // namespace

struct Renderer::Parts {
  std::shared_ptr<const tg::Bundle> bundle;
  std::unique_ptr<tg::Renderer> renderer = tg::makeCpuRenderer();
  std::mutex in_use = {};
};

Renderer::Renderer(const Model& model) : parts_(new Parts{Access::bundle(model)}) {
  guarded([&] { parts_->renderer->setModel({parts_->bundle, &parts_->bundle->model}); });
}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

Image Renderer::render(const Camera& camera, Output output, const RenderOptions& options) {
  return guarded([&] {
    tg::RenderSettings settings;
    settings.textures = modeOf(options.textures);
    settings.background = options.background ? finiteColorOf(*options.background) : parts_->bundle->background;
    settings.splat_scale = options.splat_scale;
    settings.opacity_scale = options.opacity_scale;
    settings.max_sh_degree = options.max_sh_degree;
    const auto wanted = enumOf<tg::Output>(output, Output::depthMedian, "output");
    settings.outputs = {wanted};
    const std::lock_guard lock(parts_->in_use);
    const tg::Frame frame = parts_->renderer->render(cameraOf(camera), settings);
    tg::Image image = tg::extract(frame, wanted);
    return Image{image.width, image.height, image.channels, std::move(image.data)};
  });
}

void setThreads(int count) {
  if (count < 0 || count > kMostThreads) {
    throw Error(ErrorKind::usage,
                "threads: expected 0 to " + std::to_string(kMostThreads) + ", found " + std::to_string(count));
  }
  tg::setThreadCount(count);
}

}  // namespace textured_gaussians
