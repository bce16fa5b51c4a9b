// SPDX-License-Identifier: Apache-2.0
// The CPU backend behind Renderer: the stages in order, timed.
#include <hwy/targets.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

#include "core/system/error.h"
#include "core/system/parallel.h"
#include "render/cpu/blend.h"
#include "render/cpu/pages.h"
#include "render/cpu/picture.h"
#include "render/cpu/project.h"
#include "render/cpu/solid.h"
#include "render/cpu/tiles.h"
#include "render/renderer.h"

namespace tg {
namespace {

class CpuRenderer final : public Renderer {
 public:
  void setModel(const GaussianModel& model) override { setModel(std::make_shared<const GaussianModel>(model)); }
  void setModel(std::shared_ptr<const GaussianModel> model) override {
    shared_ = std::move(model);
    texture_means_.clear();
    // A tile's splats have their texels all over the atlas.
    if (shared_) cpu::enlargePages(shared_->atlas.texels.data(), shared_->atlas.texels.size() * sizeof(glm::vec4));
  }

  Frame render(const Camera& camera, const RenderSettings& settings) override {
    if (!shared_) throw Error(ErrorKind::usage, "render", "no model set (expected setModel before render)");
    const GaussianModel& model = *shared_;
    const cpu::View view = cpu::makeView(model, camera, settings);
    Frame frame(camera.size.x, camera.size.y, settings.outputs);
    times_.clear();
    if (view.footprint && texture_means_.empty()) texture_means_ = textureMeans(model.atlas, model.size());
    const cpu::Texels texels{model.atlas.texels.data(), texture_means_.data()};
    if (isPicture(view, settings)) {
      timed("project", [&] { cpu::projectPicture(view, model, picture_); });
      timed("tiles", [&] { cpu::listPicture(picture_); });
      timed("blend", [&] { cpu::blendPicture(view, picture_, texels, frame); });
      return frame;
    }
    timed("sort", [&] { cpu::findDepthOrder(view, model, depth_order_); });
    timed("project", [&] { cpu::projectSplats(view, model, depth_order_.gaussians, screen_); });
    if (!frame.centers.empty()) {
      timed("centers", [&] { cpu::drawCenters(view, screen_, depth_order_.order, frame.centers); });
    }
    if (settings.outputs.hasAny(kHitOutputs)) {
      timed("tiles", [&] { cpu::buildTileLists(view, screen_, depth_order_.order, false, lists_); });
      timed("blend", [&] { cpu::blendFrame(view, screen_, lists_, texels, frame); });
    }
    if (!frame.ellipsoids.empty()) timed("ellipsoids", [&] { drawEllipsoids(view, frame.ellipsoids); });
    return frame;
  }

  std::vector<PassTime> passTimes() const override { return times_; }

  std::string deviceName() const override { return cpuName(); }

 private:
  static bool isPicture(const cpu::View& view, const RenderSettings& settings) {
    return kPictureOutputs.hasAll(settings.outputs) && view.order == SplatOrder::global &&
           std::max(view.size.x, view.size.y) <= cpu::kMaxPictureSide;
  }

  void drawEllipsoids(cpu::View view, std::vector<glm::vec3>& pixels) {
    view.intersection = IntersectionModel::maxResponse;
    view.fixed_radius = 1.0f;
    cpu::projectSplats(view, *shared_, depth_order_.gaussians, screen_);
    cpu::buildTileLists(view, screen_, depth_order_.order, false, lists_);
    cpu::drawEllipsoids(view, *shared_, screen_, lists_, pixels);
  }

  template <typename Body>
  void timed(const char* name, const Body& body) {
    const auto start = std::chrono::steady_clock::now();
    body();
    const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - start;
    times_.push_back({name, elapsed.count()});
  }

  std::shared_ptr<const GaussianModel> shared_;  // null before setModel
  std::vector<glm::vec4> texture_means_;         // of it, once the footprint filter has asked for them
  cpu::DepthOrder depth_order_;
  cpu::ScreenSplats screen_;
  cpu::TileLists lists_;
  cpu::PictureScene picture_;
  std::vector<PassTime> times_;
};

}  // namespace

std::string cpuName() {
  const std::int64_t compiled = hwy::SupportedTargets() & HWY_TARGETS;  // lower bits are better targets
  return std::string("CPU, ") + hwy::TargetName(compiled & -compiled) + ", " + std::to_string(threadCount()) +
         " threads";
}

std::unique_ptr<Renderer> makeCpuRenderer() { return std::make_unique<CpuRenderer>(); }

}  // namespace tg
